"""The rungs of the ladder of models: from closed forms to the general scene, and which one a design needs."""
