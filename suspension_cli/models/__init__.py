"""Models of a suspension, from closed forms to wires with mass, and the choice between them."""
