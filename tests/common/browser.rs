//! Runs pages in a headless browser, with WebGPU on the software adapter SwiftShader or without WebGPU.

use crate::common::Requirement;
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};
use tiny_http::{Header, Method, Response, Server};

const BROWSERS: [&str; 4] = ["chromium", "chromium-browser", "google-chrome", "google-chrome-stable"];
/// Name of this machine that no browser takes for a secure one.
const OTHER_HOST: &str = "pages.test";
/// Longest time between two answers of a page, for a busy machine.
const PATIENCE: Duration = Duration::from_secs(300);

/// Finds the first browser on the path; `None` and a printed line if there is none.
pub fn browser() -> Option<PathBuf> {
    let path = std::env::var_os("PATH").unwrap_or_default();
    let found = std::env::split_paths(&path)
        .flat_map(|folder| BROWSERS.map(|name| folder.join(name)))
        .find(|file| file.is_file());
    if found.is_none() {
        Requirement::Browser.missing(&format!("there is no {}", BROWSERS.join(", ")));
    }
    found
}

/// Process of a browser, which ends with this value.
struct Running(Child);

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// WebGPU of a page in the browser.
#[derive(Debug, Clone, Copy)]
#[allow(dead_code, reason = "not every test program needs all of them")]
pub enum WebGpu {
    /// The software adapter SwiftShader.
    SwiftShader,
    /// The browser finds no graphics adapter.
    NoAdapter,
    /// The page comes by http from another host, and browsers then offer no WebGPU.
    Insecure,
}

/// Opens a page, and returns the bodies that its scripts POST, by path without the leading slash. The page ends with a
/// POST to `/end`. It may GET `files` by their names. `None` and a printed line without a browser.
///
/// # Panics
/// The page posts to `/error`, or does not answer.
pub fn answers(
    page: String,
    files: &HashMap<String, Vec<u8>>,
    webgpu: WebGpu,
) -> Option<HashMap<String, Vec<u8>>> {
    let browser = browser()?;
    let server = Server::http("127.0.0.1:0").unwrap();
    let address = server.server_addr().to_ip().unwrap();
    let profile = tempfile::tempdir().unwrap();
    let address = match webgpu {
        WebGpu::Insecure => format!("http://{OTHER_HOST}:{}/", address.port()),
        _ => format!("http://{address}/"),
    };
    let _running = Running(start(&browser, profile.path(), &address, webgpu));
    let mut answers = HashMap::new();
    let mut last = Instant::now();
    loop {
        let Some(mut request) = server.recv_timeout(Duration::from_secs(1)).unwrap() else {
            assert!(last.elapsed() < PATIENCE, "the page does not answer; so far: {:?}", answers.keys());
            continue;
        };
        last = Instant::now();
        let path = request.url().trim_start_matches('/').to_owned();
        let mut body = Vec::new();
        request.as_reader().read_to_end(&mut body).unwrap();
        let reply = match (request.method(), path.as_str()) {
            (Method::Post, _) => Response::from_data(Vec::new()),
            (_, "") => Response::from_data(page.clone()).with_header(html()),
            (_, name) => match files.get(name) {
                Some(file) => Response::from_data(file.clone()),
                None => Response::from_data(Vec::new()).with_status_code(404),
            },
        };
        let posts = *request.method() == Method::Post;
        // The browser may have closed the connection.
        let _ = request.respond(reply);
        match path.as_str() {
            "error" => panic!("the page says: {}", String::from_utf8_lossy(&body)),
            "end" => return Some(answers),
            _ if posts => drop(answers.insert(path, body)),
            _ => {}
        }
    }
}

fn html() -> Header {
    Header::from_bytes("Content-Type", "text/html; charset=utf-8").unwrap()
}

fn start(browser: &Path, profile: &Path, address: &str, webgpu: WebGpu) -> Child {
    let flags: &[&str] = match webgpu {
        WebGpu::NoAdapter => &["--disable-gpu"],
        WebGpu::SwiftShader | WebGpu::Insecure => &[
            "--enable-unsafe-webgpu",
            "--use-webgpu-adapter=swiftshader",
            "--enable-features=Vulkan",
            "--use-vulkan=swiftshader",
        ],
    };
    Command::new(browser)
        .args(["--headless=new", "--no-sandbox", "--disable-dev-shm-usage", "--no-first-run"])
        .arg("--disable-background-networking")
        .arg(format!("--host-resolver-rules=MAP {OTHER_HOST} 127.0.0.1"))
        .args(flags)
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(address)
        .stdin(Stdio::null())
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap()
}
