//! `epigraph compare`: how much two images differ.

use serde_json::json;

use crate::{
    args::CompareArgs,
    error::CliError,
    flip, image_file, metrics,
    output::{JsonTarget, Target},
    picture::Picture,
    tone,
};

/// Prints RMSE, PSNR, SSIM and FLIP.
pub fn compare(args: &CompareArgs) -> Result<(), CliError> {
    let target = JsonTarget::new(args.json.as_deref())?;
    let map = args.map.as_deref().map(Target::new).transpose()?;
    let (a, b) = (Picture::read(&args.a)?, Picture::read(&args.b)?);
    if a.size != b.size {
        let size = |picture: &Picture| format!("{}x{}", picture.size[0], picture.size[1]);
        return Err(CliError::Input(format!(
            "images of one size can be compared, but {} is {} and {} is {}",
            args.a.display(),
            size(&a),
            args.b.display(),
            size(&b)
        )));
    }
    let (shown_a, shown_b) = (a.srgb(), b.srgb());
    // Eight bits are what the eye gets to see, and what other tools compare.
    let seen = |colors: &[[f32; 3]]| -> Vec<[f32; 3]> {
        colors.iter().map(|color| color.map(|channel| f32::from(tone::to_byte(channel)) / 255.0)).collect()
    };
    let errors = flip::flip(&seen(&shown_a), &seen(&shown_b), a.size);
    let rmse = metrics::rmse(&a.colors, &b.colors);
    let psnr = metrics::psnr(&shown_a, &shown_b);
    let ssim = metrics::ssim(&shown_a, &shown_b, a.size);
    let mean_flip = flip::mean(&errors);
    if let Some(map) = map {
        let png = image_file::png(a.size, &flip::magma(&errors));
        map.write(&png.map_err(|error| CliError::write(map.path(), error))?)?;
    }
    let mut text = format!("RMSE  {rmse:.6}\nPSNR  {psnr:.3} dB\nSSIM  {ssim:.6}\nFLIP  {mean_flip:.6}\n");
    if a.linear != b.linear {
        text += "One image is linear (EXR) and one sRGB (PNG): RMSE, on the values as read, mixes the two.\n";
    }
    // JSON has no infinity: equal images have no PSNR.
    let value = json!({ "rmse": rmse, "psnr": psnr, "ssim": ssim, "flip": mean_flip, "size": a.size });
    target.finish(&value, &text)
}
