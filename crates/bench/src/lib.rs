//! What tumble is measured by: other engines on the same scenes, cases with their errors, the table that a run leaves,
//! and the report made of it.

pub mod cases;
pub mod engines;
pub mod hard_cases;
pub mod machine;
pub mod record;
pub mod report;
pub mod run;
pub mod scaling;
