#include "tileflight/world/place/block_store.h"

#include <unistd.h>

#include <array>
#include <nlohmann/json.hpp>
#include <system_error>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"

namespace tileflight::place {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

json content_json(std::size_t index, const tileset::ContentRecord& content) {
  json note = tileset::to_json(content);
  note["content"] = index;
  return note;
}

json block_json(const BlockRecord& block) {
  json contents = json::array(), files = json::array();
  for (const auto& [index, content] : block.contents) contents.push_back(content_json(index, content));
  for (const fetch::CountedFile& file : block.files) files.push_back({file.uri, file.bytes});
  return {{"triangles", block.triangles},
          {"surface_points", block.surface_points},
          {"cloud_points", block.cloud_points},
          {"voxels_occupied", block.voxels_occupied},
          {"has_files", block.has_files},
          {"border", block.border},
          {"contents", contents},
          {"files", files}};
}

BlockRecord block_from_json(const json& note) {
  BlockRecord block{.triangles = note.at("triangles").get<std::size_t>(),
                    .surface_points = note.at("surface_points").get<std::size_t>(),
                    .cloud_points = note.at("cloud_points").get<std::size_t>(),
                    .voxels_occupied = note.at("voxels_occupied").get<std::size_t>(),
                    .has_files = note.at("has_files").get<bool>(),
                    .border = note.at("border").get<std::int32_t>(),
                    .contents = {},
                    .files = {}};
  for (const json& content : note.at("contents"))
    block.contents.emplace(content.at("content").get<std::size_t>(), tileset::content_record_from_json(content));
  for (const json& file : note.at("files")) block.files.push_back({file.at(0).get<std::string>(), file.at(1)});
  return block;
}

/// Tells this process from others that make the same block, on this machine or another.
std::string process_name() {
  std::array<char, 256> host{};
  const bool is_known = ::gethostname(host.data(), host.size() - 1) == 0;
  return (is_known ? std::string(host.data()) + "." : "") + std::to_string(::getpid());
}

}  // namespace

fs::path BlockStore::folder_for(const fs::path& output) { return jobs::BuildFolder::path_beside(output, "blocks"); }

bool BlockStore::exists(const fs::path& output) { return fs::is_directory(folder_for(output)); }

std::string BlockStore::prepare(const fs::path& output, const json& inputs, jobs::Share share) {
  const fs::path folder = folder_for(output);
  const std::string why = jobs::BuildFolder::prepare(folder, inputs, share, {"truth/blocks", "done"});
  std::error_code ignored;
  if (share == jobs::Share::kWhole) fs::remove_all(folder / "temporary", ignored);
  return why.empty() ? "" : "blocks of an earlier extract are not reused, " + why;
}

BlockStore::BlockStore(const fs::path& output, const std::string& name, jobs::Share share)
    : folder_(folder_for(output), name, share) {}

fs::path BlockStore::temporary_for(const std::string& block) const {
  return folder_.path() / "temporary" / (block + "." + process_name());
}

void BlockStore::add(
    const std::string& block,
    const std::function<std::pair<BlockRecord, ground_truth::QuantizationFloor>(const fs::path&)>& make) const {
  const fs::path temporary = temporary_for(block), target = truth_folder() / "blocks" / block;
  std::error_code error;
  fs::remove_all(temporary, error);
  base::make_folder(temporary);
  const base::RemovedOnExit remove_temporary(temporary);
  auto [record, floor] = make(temporary);
  record.has_files = !fs::is_empty(temporary);
  if (record.has_files) {
    // An existing folder is equal, or from a process that died before it wrote the record. A process that is killed
    // here leaves no record either.
    fs::remove(record_of(block), error);
    fs::remove_all(target, error);
    fs::rename(temporary, target, error);
    if (error && !holds(block)) throw InputError(target.string(), "cannot be written: " + error.message());
  }
  base::write_file(floor_of(block), floor.to_bytes());
  base::write_file(record_of(block), block_json(record).dump());
}

std::optional<BlockRecord> BlockStore::read(const std::string& block) const {
  if (!holds(block)) return std::nullopt;
  try {
    return block_from_json(json::parse(base::read_text(record_of(block))));
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

bool BlockStore::holds(const std::string& block) const { return fs::is_regular_file(record_of(block)); }

void BlockStore::add_floor(const std::string& block, ground_truth::QuantizationFloor& floor) const {
  floor.add_bytes(base::read_raw(floor_of(block)), floor_of(block).string());
}

}  // namespace tileflight::place
