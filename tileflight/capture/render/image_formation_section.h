#pragma once

#include "tileflight/capture/render/image_formation.h"
#include "tileflight/core/base/strict_section.h"

namespace tileflight::render {

/// Reads an ImageFormation from a section with the keys: light {model, time, turbidity, ground_albedo, exposure,
/// white_balance}, haze_visibility (m), haze_color, chromatic_red, chromatic_blue, exposure_time, exposure_samples,
/// line_delay (s), vignetting, auto_exposure {target, time_constant (s), min_gain, max_gain}, exposure_drift,
/// exposure_drift_period (s), exposure_steps [{time, gain}], white_electrons, read_noise_electrons, gamma, sharpening,
/// sharpening_radius (px). Keys that are not there keep the values of `defaults`. Unknown keys are errors that name the
/// nearest known key. Throws InputError (file, line, key).
ImageFormation read_image_formation(base::StrictSection& section, const ImageFormation& defaults = {});

}  // namespace tileflight::render
