#pragma once

#include <functional>
#include <string>

#include "tileflight/geometry/input_error.h"
#include "tileflight/sensors/frame_outputs.h"

namespace tileflight::experiment {

/// What a rendered dataset holds of each frame beside its picture (docs/formats.md, "A dataset folder").
struct RenderOutputs {
  bool depth = false;         ///< depth/: along the optical axis
  bool range = false;         ///< range/: along the ray
  bool normals = false;       ///< normals/
  bool segmentation = false;  ///< segmentation/ and segmentation.csv
  bool infrared = false;      ///< infrared/ (and segmentation.csv)
  bool flow = false;          ///< flow/: to the next frame
  bool visibility = false;    ///< visibility/: where the place that is scored is seen
  bool photometric = false;   ///< pcalib.txt and, where there is vignetting, vignette.png; of the whole flight

  /// The renderer's part of it.
  sensors::FrameOutputs of_frame() const;
};

/// "depth, flow" and so on. Throws `error` of what is wrong (the word, the nearest known one).
RenderOutputs parse_outputs(const std::string& words, const std::function<InputError(const std::string& what)>& error);

}  // namespace tileflight::experiment
