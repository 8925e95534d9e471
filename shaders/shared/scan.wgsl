// Prefix sums of lists of any length in two passes of SCAN_BLOCKS workgroups of SCAN_THREADS threads each.
// `stages/src/shared/scan.rs` declares SCAN_BLOCKS.
//
// Every workgroup works on one block, a range of the list (scan_block). The first pass sums each block:
//
//     let range = scan_block(group.x, count);
//     var sum = 0u;
//     for (var i = range.x + lane; i < range.y; i += SCAN_THREADS) { sum += value(i); }
//     let total = workgroup_scan(lane, sum).total;
//     if lane == 0u { sums[group.x] = total; }
//
// The second finds where its block starts, and goes through the block a tile of SCAN_THREADS elements at a time, with
// the sum of all elements before each one. Every thread takes part in every tile:
//
//     let before = workgroup_scan(lane, select(0u, sums[lane], lane < group.x)).total;
//     for (var tile = range.x; tile < range.y; tile += SCAN_THREADS) {
//         let i = tile + lane;
//         let scan = workgroup_scan(lane, ...value(i), or 0 from range.y on...);
//         // before + scan.before is the sum of all elements before i
//         before += scan.total;
//     }
//
// Sums wrap at 2^32.

// Threads of a workgroup: one for each block sum.
const SCAN_THREADS: u32 = SCAN_BLOCKS;

struct Scan {
    // Sum of the values of all threads before this one.
    before: u32,
    // Sum of the values of all threads of the workgroup.
    total: u32,
}

// Threads are summed in rows of this many, then the rows are; there are as many rows as threads in a row.
const SCAN_ROW: u32 = 16u;

var<workgroup> scan_values: array<u32, SCAN_THREADS>;
var<workgroup> scan_rows: array<u32, SCAN_ROW>;

// Sums over the threads of a workgroup. `lane` is local_invocation_index; all SCAN_THREADS threads of the workgroup
// must call it together. Two short serial sums need 3 barriers where log2(256) parallel steps would need 16: on
// lavapipe that is several times faster.
fn workgroup_scan(lane: u32, value: u32) -> Scan {
    // Readers of the previous call may still be running.
    workgroupBarrier();
    scan_values[lane] = value;
    workgroupBarrier();
    if lane < SCAN_ROW {
        var sum = 0u;
        for (var i = lane * SCAN_ROW; i < (lane + 1u) * SCAN_ROW; i++) {
            let value = scan_values[i];
            scan_values[i] = sum;
            sum += value;
        }
        scan_rows[lane] = sum;
    }
    workgroupBarrier();
    var scan = Scan(scan_values[lane], 0u);
    for (var row = 0u; row < SCAN_ROW; row++) {
        scan.before += select(0u, scan_rows[row], row < lane / SCAN_ROW);
        scan.total += scan_rows[row];
    }
    return scan;
}

// Start and end of a block of a list of `count` elements. Blocks are whole tiles, except where the list ends.
fn scan_block(block: u32, count: u32) -> vec2<u32> {
    let tiles = (count + SCAN_THREADS - 1u) / SCAN_THREADS;
    let length = (tiles + SCAN_BLOCKS - 1u) / SCAN_BLOCKS * SCAN_THREADS;
    return vec2(min(block * length, count), min((block + 1u) * length, count));
}
