//! Empty. The `Cargo.toml` of this package explains its purpose.
