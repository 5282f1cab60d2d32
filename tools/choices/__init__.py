"""Error and cost of `auto` on random suspensions and quantities of interest."""
