//! The collapse load: the applied force at the last step before the fitted axial strain exceeds a limit.
