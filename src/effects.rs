//! Which effects an exposure shows, hence which factors need sampling.
