//! Three-view matching: R-tables become disparities
