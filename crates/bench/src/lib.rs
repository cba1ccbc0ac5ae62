//! What tumble is measured by: other engines on the same scenes, cases with their errors, the table that a run leaves,
//! and the report made of it.

pub mod record;
