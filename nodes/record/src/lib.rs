//! Every topic into MCAP, and back out
