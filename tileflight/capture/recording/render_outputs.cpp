#include "tileflight/capture/recording/render_outputs.h"

#include <algorithm>
#include <map>
#include <vector>

#include "tileflight/core/base/document_value.h"

namespace tileflight::recording {
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
