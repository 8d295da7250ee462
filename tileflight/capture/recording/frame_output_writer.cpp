#include "tileflight/capture/recording/frame_output_writer.h"

#include <utility>
#include <vector>

#include "tileflight/data/dataset/frame_layers.h"

namespace tileflight::recording {
namespace {

std::vector<dataset::SegmentedObject> to_segmented_objects(std::span<const render::SceneObject> objects) {
  std::vector<dataset::SegmentedObject> result;
  result.reserve(objects.size());
  for (const render::SceneObject& object : objects) {
    const bool has_feature = object.feature != imaging::kNoFeature;
    result.push_back(
        {object.tile, object.mesh, has_feature ? std::optional(object.feature) : std::nullopt, object.name});
  }
  return result;
}

template <class Image>
const Image* null_if_empty(const Image& image) {
  return image.empty() ? nullptr : &image;
}

}  // namespace

FrameOutputWriter::FrameOutputWriter(std::filesystem::path dataset_folder, const RenderOutputs& outputs,
                                     const std::filesystem::path& runs)
    : folder_(std::move(dataset_folder)) {
  if (!outputs.segmentation && !outputs.infrared) return;
  segmentation_.emplace(folder_,
                        dataset::SegmentationOptions{
                            .segmentation = outputs.segmentation, .infrared = outputs.infrared, .runs_folder = runs});
}

void FrameOutputWriter::add(const render::FlightFrame& frame) {
  const render::OutputImages& images = frame.outputs;
  dataset::write_frame_layers(folder_, frame.index,
                              {.depth_m = null_if_empty(frame.depth_m),
                               .range_m = null_if_empty(images.range_m),
                               .normals = null_if_empty(images.normals),
                               .flow_px = null_if_empty(images.flow_px),
                               .visibility = null_if_empty(images.visibility)});
  if (segmentation_) segmentation_->add(frame.index, images.objects, to_segmented_objects(frame.objects));
}

void FrameOutputWriter::finish() {
  if (segmentation_) segmentation_->finish();
}

}  // namespace tileflight::recording
