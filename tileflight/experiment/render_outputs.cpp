#include "tileflight/experiment/render_outputs.h"

#include <algorithm>
#include <map>
#include <vector>

#include "tileflight/geometry/known_keys.h"

namespace tileflight::experiment {
namespace {

using Member = bool RenderOutputs::*;

const std::map<std::string, Member>& members() {
  static const std::map<std::string, Member> kMembers{
      {"depth", &RenderOutputs::depth},           {"range", &RenderOutputs::range},
      {"normals", &RenderOutputs::normals},       {"segmentation", &RenderOutputs::segmentation},
      {"infrared", &RenderOutputs::infrared},     {"flow", &RenderOutputs::flow},
      {"visibility", &RenderOutputs::visibility}, {"photometric", &RenderOutputs::photometric}};
  return kMembers;
}

std::string nearest_member(const std::string& word) {
  std::vector<std::string> known;
  for (const auto& [name, member] : members()) known.push_back(name);
  return geometry::nearest_key(word, known);
}

}  // namespace

sensors::FrameOutputs RenderOutputs::of_frame() const {
  return {
      .range = range, .normals = normals, .objects = segmentation || infrared, .flow = flow, .visibility = visibility};
}

RenderOutputs parse_outputs(const std::string& words, const std::function<InputError(const std::string& what)>& error) {
  RenderOutputs outputs;
  constexpr const char* kBetween = ", \t";
  for (std::size_t at = words.find_first_not_of(kBetween); at != std::string::npos;) {
    const std::size_t end = std::min(words.find_first_of(kBetween, at), words.size());
    const std::string word = words.substr(at, end - at);
    const auto member = members().find(word);
    if (member == members().end())
      throw error("names '" + word + "', which is no output; did you mean '" + nearest_member(word) + "'?");
    outputs.*member->second = true;
    at = words.find_first_not_of(kBetween, end);
  }
  return outputs;
}

}  // namespace tileflight::experiment
