"""Energy, forces, tangent stiffness and loss of wires, blades, springs and gas, in closed form."""
