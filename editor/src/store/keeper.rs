//! The thread that writes, so that a slow disk holds up nothing.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::mpsc,
    thread::{self, JoinHandle},
};

use epigraph_pictures::Target;

enum Order {
    Write(PathBuf, String),
    Remove(PathBuf),
    /// Tell when all before is done.
    Flush(mpsc::Sender<()>),
}

/// Its end in the window's thread. Dropping it waits until all is written.
pub struct Keeper {
    orders: Option<mpsc::Sender<Order>>,
    thread: Option<JoinHandle<()>>,
}

impl Keeper {
    pub fn start() -> Self {
        let (orders, received) = mpsc::channel();
        let work = move || received.into_iter().for_each(obey);
        Self { orders: Some(orders), thread: thread::Builder::new().name("keeper".into()).spawn(work).ok() }
    }

    /// Writes a file, whole or not at all.
    pub fn write(&self, path: PathBuf, text: String) {
        self.send(Order::Write(path, text));
    }

    /// Removes a file, if it is there.
    pub fn remove(&self, path: PathBuf) {
        self.send(Order::Remove(path));
    }

    /// Waits until all that was ordered is done.
    pub fn flush(&self) {
        let (tell, done) = mpsc::channel();
        self.send(Order::Flush(tell));
        // An error says that the thread never was.
        let _ = done.recv();
    }

    fn send(&self, order: Order) {
        if let Some(orders) = &self.orders {
            let _ = orders.send(order);
        }
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        self.orders = None;
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}

fn obey(order: Order) {
    // A folder that cannot be written to must not keep anybody from their work: what was to be kept is lost, as it would
    // be without this thread.
    match order {
        Order::Write(path, text) => {
            let _ = fs::create_dir_all(path.parent().unwrap_or(Path::new("")));
            let _ = Target::new(&path).and_then(|target| target.write(text.as_bytes()));
        }
        Order::Remove(path) => {
            let _ = fs::remove_file(path);
        }
        Order::Flush(tell) => {
            let _ = tell.send(());
        }
    }
}
