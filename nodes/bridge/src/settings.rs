//! Where viewers find the graph.

messages::settings! {
    /// Where viewers find the graph.
    pub struct Settings {
        /// The address to listen at. Nobody is asked for a password: any other than the loopback lets everybody on the
        /// network see all images and turn all parameters.
        pub host: String = "127.0.0.1".to_owned();
        /// The port to listen at; 0 for any that is free.
        pub port: u32 = 8765, in 0..=65535;
        /// Web pages that may look besides those of this machine and of the public viewers, by their origin, such as
        /// "https://viewer.example:8080"; "*" for all. A page that may look sees all images and turns all parameters.
        pub origins: Vec<String> = Vec::new();
        /// Scans that may wait for a viewer before further ones are left out for it.
        pub backlog: u32 = 2, in 1..=64;
    }
}
