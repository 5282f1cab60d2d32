"""How complete a model a design needs, and why."""
