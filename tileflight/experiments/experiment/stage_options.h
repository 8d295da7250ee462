#pragma once

#include "tileflight/core/alignment/align_map.h"
#include "tileflight/core/base/strict_section.h"
#include "tileflight/evaluation/scoring/evaluation_settings.h"
#include "tileflight/slam/odometry/odometry.h"

namespace tileflight::experiment {

using base::StrictSection;

// Sections of an experiment file that set a stage's options: keys are named as the options, without units. Each
// function reads and checks its keys; unknown ones are errors that name the nearest known key. Throw InputError (file,
// line, key).

odometry::OdometryOptions read_odometry_options(StrictSection& section);
alignment::AlignMapOptions read_alignment_options(StrictSection& section);
scoring::EvaluationSettings read_evaluation_settings(StrictSection& section);

/// Settings of `align` and `evaluate` in a file with an experiment's sections `alignment:` and `evaluation:`; other
/// sections are ignored. Throws InputError.
alignment::AlignMapOptions read_alignment_file(const std::filesystem::path& file);
scoring::EvaluationSettings read_evaluation_file(const std::filesystem::path& file);

}  // namespace tileflight::experiment
