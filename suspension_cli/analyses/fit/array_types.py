"""Array types of a fit, named by their axes."""

import numpy as np
from jaxtyping import Float, Int

Numbers = Float[np.ndarray, " number"]
NumberMatrix = Float[np.ndarray, "number number"]
Unknowns = Float[np.ndarray, " unknown"]
UnknownMatrix = Float[np.ndarray, "unknown unknown"]
ModeValues = Float[np.ndarray, " mode"]
ModeIndex = Int[np.ndarray, " mode"]
Frequencies = Float[np.ndarray, " frequency"]
