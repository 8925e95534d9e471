//! `epigraph compare`: measures the difference between two images.

use epigraph_pictures::{Difference, Picture, Ramp, metrics, png};
use serde_json::json;

use crate::{args::CompareArgs, edge_mask, error::CliError, output::Outputs, progress};

/// Prints RMSE, PSNR, SSIM and FLIP.
pub fn compare(args: &CompareArgs) -> Result<(), CliError> {
    let mut outputs = Outputs::default();
    let map = args.map.as_deref().map(|path| outputs.add("--map", path)).transpose()?;
    let json = outputs.json(args.json.as_deref())?;
    // Before the pictures, so that not all three are in memory.
    let mask = args.mask.as_deref().map(edge_mask::read).transpose()?;
    let (a, b) = (Picture::read(&args.a)?, Picture::read(&args.b)?);
    if a.size != b.size {
        let size = |picture: &Picture| format!("{}x{}", picture.size[0], picture.size[1]);
        return Err(CliError::Input(format!(
            "the images differ in size: {} is {}, but {} is {}",
            args.a.display(),
            size(&a),
            args.b.display(),
            size(&b)
        )));
    }
    let mask = mask.map(|mask| mask.of_size(a.size)).transpose()?;
    let mut outputs = outputs.ready()?;
    // Twice: for FLIP and for SSIM.
    let bar = progress::bar(2 * a.colors.len() as u64, "comparing", "pixels");
    let mut finished = |pixels: usize| bar.inc(pixels as u64);
    let difference = Difference::watched(&a, &b, &mut finished);
    let ssim = difference.ssim_watched(&mut finished);
    bar.finish_and_clear();
    if let Some(map) = map {
        let colors: Vec<[u8; 3]> = difference.errors.iter().map(|&error| Ramp::Magma.color(error)).collect();
        let png = png(a.size, &colors).map_err(|error| CliError::write(outputs.path(map), error))?;
        outputs.put(map, &png)?;
    }
    let rmse = metrics::rmse(&a.colors, &b.colors);
    let (psnr, flip) = (difference.psnr(), difference.flip());
    let mut text = format!("RMSE  {rmse:.6}\nPSNR  {psnr:.3} dB\nSSIM  {ssim:.6}\nFLIP  {flip:.6}\n");
    if a.linear != b.linear {
        text += "One image is linear (EXR), the other sRGB (PNG): RMSE compares their values as stored.\n";
    }
    // JSON has no infinity: the PSNR of equal images becomes null.
    let mut value = json!({ "rmse": rmse, "psnr": psnr, "ssim": ssim, "flip": flip, "size": a.size });
    if let Some(mask) = mask {
        let share = edge_mask::share(&mask);
        let (psnr, flip) = (difference.psnr_within(&mask), difference.flip_within(&mask));
        text += &format!(
            "within the mask, {:.1}% of the pixels:\nPSNR  {psnr:.3} dB\nFLIP  {flip:.6}\n",
            100.0 * share
        );
        value["mask"] = json!({ "share": share, "psnr": psnr, "flip": flip });
    }
    outputs.finish(json, &value, &text)
}
