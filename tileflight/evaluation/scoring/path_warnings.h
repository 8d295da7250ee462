#pragma once

#include "tileflight/core/base/warning.h"
#include "tileflight/evaluation/registration/register_map.h"
#include "tileflight/evaluation/scoring/map_inputs.h"

namespace tileflight::scoring {

/// Lowers to Severity::kNote what odometry suspects of its path as a whole (`path_warnings` of odometry.json: its
/// directions disagree, the scale may have drifted), where images of the flight measured that path: nine of ten tried
/// images or more, each located in the place on its own, differ from its best fit by at most half a percent of its
/// length (RMS).
void answer_path_warnings(const MapInputs& map, const registration::PictureAgreement& pictures, Warnings& warnings);

}  // namespace tileflight::scoring
