"""What linear systems give, for every analysis: noise, loops, loads, couplings, wire modes."""
