#pragma once

#include <filesystem>
#include <functional>
#include <optional>
#include <string>

#include "tileflight/capture/render/frame_outputs.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/dataset/segmentation.h"

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

  /// Returns the outputs that the renderer computes.
  render::OutputChannels to_frame_outputs() const;
};

/// Parses "depth, flow" and so on. Throws `error` for an unknown name, with the nearest known one.
RenderOutputs parse_outputs(const std::string& words, const std::function<InputError(const std::string& what)>& error);

/// Writes the outputs of a flight's frames, in any order and from several threads, into a dataset's folder.
class FrameOutputWriter {
 public:
  /// `runs`: see dataset::SegmentationOptions::runs_folder.
  FrameOutputWriter(std::filesystem::path dataset_folder, const RenderOutputs& outputs,
                    const std::filesystem::path& runs);

  /// Throws InputError.
  void add(const render::FlightFrame& frame);
  /// Writes the outputs that need all frames.
  void finish();

 private:
  std::filesystem::path folder_;
  std::optional<dataset::SegmentationWriter> segmentation_;
};

}  // namespace tileflight::recording
