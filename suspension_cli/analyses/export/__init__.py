"""Export state space for control tools: mat, npz, hdf5, zpk, python-control, Foton."""
