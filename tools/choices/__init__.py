"""Whether `auto` keeps its promise: random suspensions, what is asked of them, its error and its cost."""
