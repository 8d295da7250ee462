#include "tileflight/data/dataset/dataset_metadata.h"

#include <yaml-cpp/yaml.h>

#include <cassert>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::dataset {

namespace {

constexpr std::uintmax_t kMaxFileSize = std::uintmax_t{1} << 24;
constexpr int kMaxDepth = 32;

void flatten(const YAML::Node& node, const std::string& key, int depth, std::map<std::string, std::string>& about) {
  if (depth > kMaxDepth) return;
  const std::string prefix = key.empty() ? "" : key + ".";
  if (node.IsScalar()) about[key] = node.Scalar();
  if (node.IsMap())
    for (const auto& entry : node) flatten(entry.second, prefix + entry.first.as<std::string>(""), depth + 1, about);
  if (node.IsSequence())
    for (std::size_t i = 0; i < node.size(); ++i) flatten(node[i], prefix + std::to_string(i), depth + 1, about);
}

/// A tree view of the flat keys.
struct MetadataNode {
  std::string value;
  std::map<std::string, MetadataNode> children;
};

void put(MetadataNode& root, const std::string& key, const std::string& value) {
  MetadataNode* at = &root;
  for (std::size_t begin = 0; begin <= key.size();) {
    const std::size_t end = std::min(key.find('.', begin), key.size());
    at = &at->children[key.substr(begin, end - begin)];
    begin = end + 1;
  }
  at->value = value;
}

void emit(const MetadataNode& branch, YAML::Emitter& out) {
  assert(branch.value.empty() || branch.children.empty());  // a key cannot hold both a text and further keys
  if (branch.children.empty()) {
    out << YAML::DoubleQuoted << branch.value;
    return;
  }
  out << YAML::BeginMap;
  for (const auto& [key, child] : branch.children) {
    out << YAML::Key << key << YAML::Value;
    emit(child, out);
  }
  out << YAML::EndMap;
}

}  // namespace

std::map<std::string, std::string> read_metadata(const std::filesystem::path& file) {
  const std::string text = base::read_text(file, kMaxFileSize);
  std::map<std::string, std::string> about;
  try {
    flatten(YAML::Load(text), "", 0, about);
  } catch (const YAML::Exception& error) {
    throw InputError(file.string(), "line " + std::to_string(error.mark.line + 1) + ": not valid YAML: " + error.msg);
  }
  return about;
}

std::string format_metadata(const std::map<std::string, std::string>& about) {
  if (about.empty()) return "{}\n";
  MetadataNode root;
  for (const auto& [key, value] : about) put(root, key, value);
  YAML::Emitter out;
  emit(root, out);
  return std::string(out.c_str()) + "\n";
}

}  // namespace tileflight::dataset
