#include "tileflight/experiment/output_files.h"

#include <utility>
#include <vector>

#include "tileflight/dataset/frame_layers.h"

namespace tileflight::experiment {
namespace {

std::vector<dataset::SegmentedObject> segmented(std::span<const sensors::SceneObject> objects) {
  std::vector<dataset::SegmentedObject> result;
  result.reserve(objects.size());
  for (const sensors::SceneObject& object : objects) {
    const bool has_feature = object.feature != imaging::kNoFeature;
    result.push_back(
        {object.tile, object.mesh, has_feature ? std::optional(object.feature) : std::nullopt, object.name});
  }
  return result;
}

template <class Image>
const Image* if_any(const Image& image) {
  return image.empty() ? nullptr : &image;
}

}  // namespace

OutputFiles::OutputFiles(std::filesystem::path dataset_folder, const RenderOutputs& outputs,
                         const std::filesystem::path& runs)
    : folder_(std::move(dataset_folder)) {
  if (!outputs.segmentation && !outputs.infrared) return;
  segmentation_.emplace(folder_, dataset::SegmentationOptions{
                                     .segmentation = outputs.segmentation, .infrared = outputs.infrared, .runs = runs});
}

void OutputFiles::add(const sensors::SensedFrame& frame) {
  const sensors::OutputImages& images = frame.outputs;
  dataset::write_frame_layers(folder_, frame.index,
                              {.depth_m = if_any(frame.depth_m),
                               .range_m = if_any(images.range_m),
                               .normals = if_any(images.normals),
                               .flow_px = if_any(images.flow_px),
                               .visibility = if_any(images.visibility)});
  if (segmentation_) segmentation_->add(frame.index, images.objects, segmented(frame.objects));
}

void OutputFiles::finish() {
  if (segmentation_) segmentation_->finish();
}

}  // namespace tileflight::experiment
