//! Generalized Hough transform: every curve becomes an R-table
