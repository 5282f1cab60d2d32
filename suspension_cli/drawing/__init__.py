"""House style of pictures, and drawings of suspensions."""
