#pragma once

#include <filesystem>
#include <optional>

#include "tileflight/data/dataset/segmentation.h"
#include "tileflight/capture/render/render_flight.h"
#include "tileflight/capture/recording/render_outputs.h"

namespace tileflight::recording {

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
