"""Pictures: each draws a result object or a scene, and computes nothing physical.

The only part that imports matplotlib, and never its pyplot: figures are plain objects on the Agg canvas.
"""
