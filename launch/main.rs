//! tricurve: depth from curves in three views.
fn main(){}
