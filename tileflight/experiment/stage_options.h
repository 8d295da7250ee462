#pragma once

#include "tileflight/alignment/align_map.h"
#include "tileflight/base/strict_section.h"
#include "tileflight/odometry/odometry.h"
#include "tileflight/render/image_formation.h"

namespace tileflight::experiment {

using base::StrictSection;

// Sections of an experiment file that set a stage's options: keys are named as the options, without units. Each
// function reads and checks its keys; unknown ones are errors that name the nearest known key. Throw InputError (file,
// line, key).

render::ImageFormation read_image_formation(StrictSection& section);
odometry::OdometryOptions read_odometry_options(StrictSection& section);
alignment::AlignMapOptions read_alignment_options(StrictSection& section);

}  // namespace tileflight::experiment
