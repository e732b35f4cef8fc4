//! A small `.marq` file, a running server, and an HTTP client that hides nothing.

pub(crate) mod objects;

use marquetry_format::writer::{
    ChartInput, ChartTiles, ColourInput, Content, NodeInput, TileInput, write,
};
use marquetry_format::{
    ContentKind, Lattice, Metadata, NodeId, NormalCone, PageSamples, Quadrant, TexelSize,
};
use marquetry_server::{Config, Server};
use std::fmt::Write as _;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::thread::JoinHandle;
use std::time::Duration;
use tokio::sync::oneshot;

/// A WebP file of 16 × 12 pixels.
pub(crate) const PICTURE: &[u8] =
    include_bytes!("../../../../format/tests/data/thumbnail_16x12.webp");

/// Bytes of a file with one chart of five pages; `seed` makes its content, and so its content id.
pub(crate) fn marq(seed: u32) -> Vec<u8> {
    written(seed, None, None)
}

/// The same with a picture, [`PICTURE`].
pub(crate) fn pictured_marq(seed: u32) -> Vec<u8> {
    written(seed, None, Some(PICTURE))
}

/// The same with three colour tiles.
pub(crate) fn textured_marq(seed: u32) -> Vec<u8> {
    let frame = include_bytes!("../../../../format/tests/data/tile_12x12.vp8");
    let tile = |children| TileInput {
        bytes: frame.to_vec(),
        children,
    };
    let leaf = || Some(Box::new(tile([const { None }; 4])));
    let size = TexelSize {
        width: 8,
        height: 8,
    };
    let root = tile([leaf(), None, None, leaf()]);
    written(seed, Some(&vec![Some(ChartTiles { size, root })]), None)
}

fn written(seed: u32, colour: Option<&ColourInput>, thumbnail: Option<&[u8]>) -> Vec<u8> {
    let lattice = Lattice {
        origin: [0.0; 3],
        step: 1e-3,
        shift: 0,
    };
    let metadata = Metadata {
        kind: ContentKind::Scan,
        lattice,
        bounds_min: [0.0; 3],
        bounds_max: [1.0, 1.0, 0.5],
        up_axis: 2,
        has_colours: false,
        target_error_rel: 1e-3,
        max_error_rel: 1e-3,
        rms_error_rel: 1e-4,
        source_triangles: 7,
        source_vertices: 5,
        source_name: "test.ply".to_owned(),
        generator: "test".to_owned(),
    };
    let root = NodeId::root(marquetry_format::ChartId(0));
    let children = [0, 1, 2, 3].map(|quadrant| node(root.child(Quadrant(quadrant)), None, seed));
    let chart = ChartInput {
        glue: [None; 4],
        root: node(root, Some(Box::new(children)), seed),
    };
    let mut bytes = Vec::new();
    let content = Content {
        charts: &[chart],
        colour,
        thumbnail,
        ..Content::default()
    };
    write(&metadata, &lattice, &content, &mut bytes).unwrap();
    bytes
}

fn node(id: NodeId, children: Option<Box<[NodeInput; 4]>>, seed: u32) -> NodeInput {
    let spacing = 16 >> id.level;
    let samples = (0..33u32 * 33).map(|n| {
        let (i, j) = (n % 33 + 32 * id.x, n / 33 + 32 * id.y);
        let (x, y) = (i * spacing, j * spacing);
        [x, y, (x * 7 + y * 13 + x * y * (seed + 1)) % 251]
    });
    let positions: Vec<_> = samples.collect();
    NodeInput {
        samples: PageSamples {
            resolution: 5,
            normals: vec![[128, 128]; positions.len()],
            positions,
            ..PageSamples::default()
        },
        errors: if id.level == 0 {
            vec![8.0; 6]
        } else {
            vec![4.0]
        },
        cone: NormalCone {
            axis: [0.0, 0.0, 1.0],
            cos: -1.0,
        },
        children,
    }
}

/// A server on a free port, stopped when dropped.
pub(crate) struct Running {
    pub(crate) address: SocketAddr,
    pub(crate) admin: Option<SocketAddr>,
    stop: Option<oneshot::Sender<()>>,
    thread: Option<JoinHandle<()>>,
}

impl Running {
    /// Starts a server and waits until it listens.
    pub(crate) fn start(config: Config) -> Self {
        let (stop, stopped) = oneshot::channel::<()>();
        let (ready, listening) = std::sync::mpsc::channel();
        let thread = std::thread::spawn(move || {
            let runtime = tokio::runtime::Builder::new_multi_thread()
                .worker_threads(2)
                .enable_all()
                .build()
                .unwrap();
            runtime.block_on(async {
                let server = Server::bind(config).await.unwrap();
                ready
                    .send((server.local_addr(), server.admin_addr()))
                    .unwrap();
                server
                    .run(async {
                        let _ = stopped.await;
                    })
                    .await;
            });
        });
        let (address, admin) = listening.recv().unwrap();
        Self {
            address,
            admin,
            stop: Some(stop),
            thread: Some(thread),
        }
    }

    /// Asks the server to stop and waits until it has.
    pub(crate) fn stop(&mut self) {
        self.stop.take().map(|stop| stop.send(()));
        if let Some(thread) = self.thread.take() {
            thread.join().unwrap();
        }
    }

    /// A GET without more headers.
    pub(crate) fn get(&self, path: &str) -> Answer {
        self.send("GET", path, &[])
    }

    /// One request on a connection of its own.
    pub(crate) fn send(&self, method: &str, path: &str, headers: &[(&str, &str)]) -> Answer {
        self.try_send(method, path, headers)
            .expect("a response has a header")
    }

    /// As [`Running::send`]; nothing where the server ended the connection without a header.
    pub(crate) fn try_send(
        &self,
        method: &str,
        path: &str,
        headers: &[(&str, &str)],
    ) -> Option<Answer> {
        let mut request =
            format!("{method} {path} HTTP/1.1\r\nHost: test\r\nConnection: close\r\n");
        for (name, value) in headers {
            let _ = write!(request, "{name}: {value}\r\n");
        }
        request.push_str("\r\n");
        try_exchange(self.address, request.as_bytes())
    }

    /// A bare connection.
    pub(crate) fn connect(&self) -> TcpStream {
        let stream = TcpStream::connect(self.address).unwrap();
        stream
            .set_read_timeout(Some(Duration::from_secs(10)))
            .unwrap();
        stream
    }
}

/// Sends bytes, and takes the first response.
pub(crate) fn exchange(address: SocketAddr, request: &[u8]) -> Answer {
    try_exchange(address, request).expect("a response has a header")
}

fn try_exchange(address: SocketAddr, request: &[u8]) -> Option<Answer> {
    let mut stream = TcpStream::connect(address).unwrap();
    let patience = Some(Duration::from_secs(20));
    stream.set_read_timeout(patience).unwrap();
    // A server that refuses a request need not read it to its end.
    let _ = stream.write_all(request);
    let mut bytes = Vec::new();
    let _ = stream.read_to_end(&mut bytes);
    Answer::parse(&bytes)
}

impl Drop for Running {
    fn drop(&mut self) {
        self.stop();
    }
}

/// A response as it came.
#[derive(Debug, Clone)]
pub(crate) struct Answer {
    pub(crate) status: u16,
    headers: Vec<(String, String)>,
    pub(crate) body: Vec<u8>,
}

impl Answer {
    fn parse(bytes: &[u8]) -> Option<Self> {
        let end = bytes.windows(4).position(|window| window == b"\r\n\r\n")?;
        let head = std::str::from_utf8(&bytes[..end]).unwrap();
        let mut lines = head.split("\r\n");
        let status = lines.next().unwrap().split(' ').nth(1).unwrap();
        Some(Self {
            status: status.parse().unwrap(),
            headers: lines
                .map(|line| line.split_once(": ").unwrap())
                .map(|(name, value)| (name.to_ascii_lowercase(), value.to_owned()))
                .collect(),
            body: bytes[end + 4..].to_vec(),
        })
    }

    /// The value of a header that is there at most once.
    pub(crate) fn header(&self, name: &str) -> Option<&str> {
        let mut values = self.headers.iter().filter(|(n, _)| n == name);
        let value = values.next().map(|(_, value)| value.as_str());
        assert!(values.next().is_none(), "{name} is there twice");
        value
    }

    pub(crate) fn text(&self) -> &str {
        std::str::from_utf8(&self.body).unwrap()
    }
}
