#pragma once

#include <filesystem>
#include <optional>

#include "tileflight/dataset/segmentation.h"
#include "tileflight/experiment/render_outputs.h"
#include "tileflight/sensors/fly.h"

namespace tileflight::experiment {

/// Writes the outputs of a flight's frames, which may come in any order and from several threads, into a dataset's
/// folder.
class OutputFiles {
 public:
  /// `runs`: dataset::SegmentationOptions::runs.
  OutputFiles(std::filesystem::path dataset_folder, const RenderOutputs& outputs, const std::filesystem::path& runs);

  /// Throws InputError.
  void add(const sensors::SensedFrame& frame);
  /// What can only be written when all frames are there.
  void finish();

 private:
  std::filesystem::path folder_;
  std::optional<dataset::SegmentationWriter> segmentation_;
};

}  // namespace tileflight::experiment
