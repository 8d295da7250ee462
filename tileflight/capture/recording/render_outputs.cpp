#include "tileflight/capture/recording/render_outputs.h"

#include <algorithm>
#include <map>
#include <utility>
#include <vector>

#include "tileflight/core/base/document_value.h"
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

namespace {

using OutputFlag = bool RenderOutputs::*;

const std::map<std::string, OutputFlag>& output_flags() {
  static const std::map<std::string, OutputFlag> kMembers{
      {"depth", &RenderOutputs::depth},           {"range", &RenderOutputs::range},
      {"normals", &RenderOutputs::normals},       {"segmentation", &RenderOutputs::segmentation},
      {"infrared", &RenderOutputs::infrared},     {"flow", &RenderOutputs::flow},
      {"visibility", &RenderOutputs::visibility}, {"photometric", &RenderOutputs::photometric}};
  return kMembers;
}

std::string nearest_member(const std::string& word) {
  std::vector<std::string> known;
  for (const auto& [name, member] : output_flags()) known.push_back(name);
  return base::nearest_key(word, known);
}

}  // namespace

render::OutputChannels RenderOutputs::to_frame_outputs() const {
  return {
      .range = range, .normals = normals, .objects = segmentation || infrared, .flow = flow, .visibility = visibility};
}

RenderOutputs parse_outputs(const std::string& words, const std::function<InputError(const std::string& what)>& error) {
  RenderOutputs outputs;
  constexpr const char* kBetween = ", \t";
  for (std::size_t at = words.find_first_not_of(kBetween); at != std::string::npos;) {
    const std::size_t end = std::min(words.find_first_of(kBetween, at), words.size());
    const std::string word = words.substr(at, end - at);
    const auto member = output_flags().find(word);
    if (member == output_flags().end())
      throw error("names '" + word + "', which is not an output; did you mean '" + nearest_member(word) + "'?");
    outputs.*member->second = true;
    at = words.find_first_not_of(kBetween, end);
  }
  return outputs;
}

}  // namespace tileflight::recording
