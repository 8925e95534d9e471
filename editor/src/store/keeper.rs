//! The thread that writes files, so that a slow disk blocks nothing.

use std::{
    fs,
    path::{Path, PathBuf},
    sync::mpsc,
    thread::{self, JoinHandle},
};

use epigraph_files::Target;

enum Order {
    Write(PathBuf, String),
    Remove(PathBuf),
    /// Signal when all earlier requests are done.
    Flush(mpsc::Sender<()>),
}

/// The window thread's handle to it. Dropping it waits until everything is written.
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

    /// Removes a file, if it exists.
    pub fn remove(&self, path: PathBuf) {
        self.send(Order::Remove(path));
    }

    /// Waits until all requests are done.
    pub fn flush(&self) {
        let (tell, done) = mpsc::channel();
        self.send(Order::Flush(tell));
        // An error means that the thread could not be started.
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
    // A folder that cannot be written to must not interrupt the user's work: the file is lost, as it would
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
