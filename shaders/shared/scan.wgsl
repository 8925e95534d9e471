// Prefix sums of lists of any length in two passes of SCAN_BLOCKS workgroups of SCAN_THREADS threads each.
//
// Every workgroup works on one block, a stretch of the list (scan_block). The first pass adds up each block:
//
//     let range = scan_block(group.x, count);
//     var sum = 0u;
//     for (var i = range.x + lane; i < range.y; i += SCAN_THREADS) { sum += value(i); }
//     let total = workgroup_scan(lane, sum).total;
//     if lane == 0u { sums[group.x] = total; }
//
// The second finds where its block starts, goes through the block a tile of SCAN_THREADS elements at a time, and knows
// for each element the sum of all before it. Every thread takes part in every tile:
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

// Workgroups of a pass; also the number of block sums, one for each thread of a workgroup.
const SCAN_BLOCKS: u32 = 256u;

// Threads of a workgroup.
const SCAN_THREADS: u32 = 256u;

struct Scan {
    // Sum of the values of all threads before this one.
    before: u32,
    // Sum of the values of all threads of the workgroup.
    total: u32,
}

var<workgroup> scan_sums: array<u32, SCAN_THREADS>;

// Sums over the threads of a workgroup (Hillis and Steele 1986). `lane` is local_invocation_index; all SCAN_THREADS
// threads of the workgroup have to call it together.
fn workgroup_scan(lane: u32, value: u32) -> Scan {
    // Readers of the call before may still be at work.
    workgroupBarrier();
    scan_sums[lane] = value;
    workgroupBarrier();
    for (var step = 1u; step < SCAN_THREADS; step *= 2u) {
        var left = 0u;
        if lane >= step {
            left = scan_sums[lane - step];
        }
        workgroupBarrier();
        scan_sums[lane] += left;
        workgroupBarrier();
    }
    return Scan(scan_sums[lane] - value, scan_sums[SCAN_THREADS - 1u]);
}

// Start and end of a block of a list of `count` elements. Blocks are whole tiles, except where the list ends.
fn scan_block(block: u32, count: u32) -> vec2<u32> {
    let tiles = (count + SCAN_THREADS - 1u) / SCAN_THREADS;
    let length = (tiles + SCAN_BLOCKS - 1u) / SCAN_BLOCKS * SCAN_THREADS;
    return vec2(min(block * length, count), min((block + 1u) * length, count));
}
