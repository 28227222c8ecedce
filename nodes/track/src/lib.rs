//! Raster tracking: zero-crossings become curves
