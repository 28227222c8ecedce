//! Laplacian of Gaussian by FFT, zero-crossings, gradients
