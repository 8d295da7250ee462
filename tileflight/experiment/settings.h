#pragma once

#include "tileflight/alignment/align_map.h"
#include "tileflight/geometry/yaml_section.h"
#include "tileflight/odometry/options.h"
#include "tileflight/sensors/image_formation.h"

namespace tileflight::experiment {

using geometry::YamlSection;

// The sections of an experiment file that set a stage's options: keys named as the options are, without their units.
// Each reads and checks its keys; unknown ones are errors that name the nearest known key. Throw InputError (file,
// line, key).

sensors::ImageFormation read_image_formation(YamlSection& section);
odometry::OdometryOptions read_odometry_options(YamlSection& section);
alignment::AlignMapOptions read_alignment(YamlSection& section);

}  // namespace tileflight::experiment
