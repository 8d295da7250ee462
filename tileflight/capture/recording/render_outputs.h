#pragma once

#include <functional>
#include <string>

#include "tileflight/core/base/input_error.h"
#include "tileflight/capture/render/frame_outputs.h"

namespace tileflight::recording {

/// Outputs of a rendered dataset besides the images (docs/formats.md, "A dataset folder").
struct RenderOutputs {
  bool depth = false;         ///< depth/: along the optical axis
  bool range = false;         ///< range/: along the ray
  bool normals = false;       ///< normals/
  bool segmentation = false;  ///< segmentation/ and segmentation.csv
  bool infrared = false;      ///< infrared/ (and segmentation.csv)
  bool flow = false;          ///< flow/: to the next frame
  bool visibility = false;    ///< visibility/: pixels in which the scored region is visible
  bool photometric = false;   ///< pcalib.txt and, with vignetting, vignette.png; once per flight

  /// The outputs that the renderer computes.
  render::OutputChannels to_frame_outputs() const;
};

/// Parses "depth, flow" and so on. Throws `error` for an unknown name, with the nearest known one.
RenderOutputs parse_outputs(const std::string& words, const std::function<InputError(const std::string& what)>& error);

}  // namespace tileflight::recording
