"""The general mechanics: elements with energy, force and tangent stiffness in closed form, and what is built of them."""
