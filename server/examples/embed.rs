//! The server within a program of one's own: `embed [serve] PATH… [--listen ADDR]`, and settings from the environment
//! as `marquetry serve` takes them.

use marquetry_server::{Config, Server, config};
use std::error::Error;

#[tokio::main]
async fn main() -> Result<(), Box<dyn Error>> {
    let mut settings: Config = config::load(None, std::env::vars())?;
    let mut arguments = std::env::args().skip(1).peekable();
    arguments.next_if(|first| first == "serve");
    while let Some(argument) = arguments.next() {
        if argument == "--listen" {
            settings.listen = arguments.next().ok_or("--listen takes an address")?;
        } else {
            settings.paths.push(argument.into());
        }
    }
    let server = Server::bind(settings).await?;
    println!("listening on http://{}", server.local_addr());
    server.run(std::future::pending()).await;
    Ok(())
}
