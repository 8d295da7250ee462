#pragma once

#include <filesystem>
#include <optional>

#include "tileflight/dataset/segmentation.h"
#include "tileflight/render/render_flight.h"
#include "tileflight/survey/render_outputs.h"

namespace tileflight::survey {

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

}  // namespace tileflight::survey
