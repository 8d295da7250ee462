#include "tileflight/capture/recording/frame_store.h"

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <system_error>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/frame_list.h"

namespace tileflight::recording {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

constexpr std::uintmax_t kMaxRecord_bytes = 1 << 20, kMaxTiles_bytes = std::uintmax_t{1} << 30;

json read_json(const fs::path& file, std::uintmax_t max_bytes = kMaxRecord_bytes) {
  try {
    return json::parse(base::read_text(file, max_bytes));
  } catch (const std::exception&) {
    return nullptr;
  }
}

json finite_or_null(double value) { return std::isfinite(value) ? json(value) : json(); }

double infinite_if_null(const json& value) {
  return value.is_null() ? std::numeric_limits<double>::infinity() : value.get<double>();
}

json to_json(const FrameRecord& frame) {
  const render::ViewStatistics& view = frame.check.view;
  return {{"exposure_ms", frame.exposure_ms},
          {"rays", view.rays},
          {"surfaces", view.surfaces},
          {"back_faces", view.back_faces},
          {"nearest_m", finite_or_null(view.nearest_m)},
          {"clearance_m", finite_or_null(frame.check.surroundings.clearance_m)},
          {"above_ground_m", finite_or_null(frame.check.surroundings.above_ground_m)},
          {"inside", frame.check.surroundings.inside},
          {"path_is_blocked", frame.check.path_is_blocked},
          {"cut", frame.cut}};
}

std::optional<FrameRecord> record_from_json(const json& note) {
  try {
    FrameRecord frame;
    frame.exposure_ms = note.at("exposure_ms").get<double>();
    frame.check.view.rays = note.at("rays").get<std::int64_t>();
    frame.check.view.surfaces = note.at("surfaces").get<std::int64_t>();
    frame.check.view.back_faces = note.at("back_faces").get<std::int64_t>();
    frame.check.view.nearest_m = infinite_if_null(note.at("nearest_m"));
    frame.check.surroundings.clearance_m = infinite_if_null(note.at("clearance_m"));
    frame.check.surroundings.above_ground_m = infinite_if_null(note.at("above_ground_m"));
    frame.check.surroundings.inside = note.at("inside").get<bool>();
    frame.check.path_is_blocked = note.at("path_is_blocked").get<bool>();
    frame.cut = note.at("cut").get<std::string>();
    return frame;
  } catch (const json::exception&) {
    return std::nullopt;
  }
}

/// "000012.json" -> 12.
std::optional<std::size_t> index_of(const fs::path& note) {
  const std::string name = note.stem().string();
  std::size_t index = 0;
  const auto [end, fault] = std::from_chars(name.data(), name.data() + name.size(), index);
  if (note.extension() != ".json" || fault != std::errc() || end != name.data() + name.size()) return std::nullopt;
  return index;
}

fs::path picture_file(const fs::path& folder, std::size_t index) {
  return folder / "pictures" / (dataset::frame_id(index) + ".picture");
}

}  // namespace

std::vector<std::optional<render::FrameCheck>> frame_checks(const std::vector<FrameRecord>& frames) {
  std::vector<std::optional<render::FrameCheck>> checks;
  for (const FrameRecord& frame : frames) checks.emplace_back(frame.check);
  return checks;
}

std::string describe_frame_ranges(const std::vector<std::size_t>& frames) {
  constexpr int kMaxRuns = 8;
  std::string text;
  int runs = 0;
  for (std::size_t i = 0; i < frames.size(); ++i, ++runs) {
    if (runs == kMaxRuns) return text + " and " + std::to_string(frames.size() - i) + " more";
    const std::size_t first = i;
    while (i + 1 < frames.size() && frames[i + 1] == frames[i] + 1) ++i;
    if (runs > 0) text += i + 1 == frames.size() ? " and " : ", ";
    text += std::to_string(frames[first]);
    if (i > first) text += (i == first + 1 ? ", " : " to ") + std::to_string(frames[i]);
  }
  return text;
}

fs::path FrameStore::folder_for(const fs::path& dataset) { return jobs::BuildFolder::path_beside(dataset, "frames"); }

bool FrameStore::exists(const fs::path& dataset) { return fs::is_directory(folder_for(dataset)); }

std::string FrameStore::prepare(const fs::path& dataset, const json& inputs, jobs::Share share) {
  const std::string why = jobs::BuildFolder::prepare(folder_for(dataset), inputs, share, {"frames", "dataset"});
  return why.empty() ? "" : "frames of an earlier render are not reused, " + why;
}

FrameStore::FrameStore(const fs::path& dataset, const std::string& part)
    : folder_(folder_for(dataset), part.empty() ? "all" : part,
              part.empty() ? jobs::Share::kWhole : jobs::Share::kPart) {}

void FrameStore::add(std::size_t index, const FrameRecord& frame) const {
  base::write_file(folder_.path() / "frames" / (dataset::frame_id(index) + ".json"), to_json(frame).dump());
}

void FrameStore::add_picture(std::size_t index, const imaging::RgbImage& picture) const {
  base::make_folder(folder_.path() / "pictures");
  const std::vector<std::byte> bytes = imaging::encode_quick_picture(picture);
  base::write_file(picture_file(folder_.path(), index), {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

imaging::RgbImage FrameStore::read_picture(std::size_t index) const {
  const fs::path file = picture_file(folder_.path(), index);
  return imaging::decode_quick_picture(base::read_bytes(file), file.string());
}

void FrameStore::add_tiles(const json& records) const {
  base::make_folder(folder_.path() / "tiles");
  const std::string text = records.dump();
  base::write_file(folder_.path() / "tiles" / (base::sha256_hex(text) + ".json"), text);
}

std::vector<json> FrameStore::read_tiles() const {
  std::vector<json> records;
  std::error_code error;
  for (fs::directory_iterator entry(folder_.path() / "tiles", error), end; !error && entry != end;
       entry.increment(error)) {
    if (entry->path().extension() == ".json") records.push_back(read_json(entry->path(), kMaxTiles_bytes));
  }
  return records;
}

std::map<std::size_t, FrameRecord> FrameStore::read_frames() const {
  std::map<std::size_t, FrameRecord> frames;
  std::error_code error;
  for (fs::directory_iterator entry(folder_.path() / "frames", error), end; !error && entry != end;
       entry.increment(error)) {
    const std::optional<std::size_t> index = index_of(entry->path());
    if (!index) continue;
    if (const auto frame = record_from_json(read_json(entry->path()))) frames[*index] = *frame;
  }
  return frames;
}

void FrameStore::remove() const { folder_.remove(); }

FrameAssignment::FrameAssignment(const FrameStore* kept, std::size_t frames,
                                 const std::optional<jobs::IndexRange>& part)
    : store_(kept),
      is_part_(part.has_value()),
      range_(part.value_or(jobs::IndexRange{0, frames})),
      previous_cuts_(frames),
      is_finished_(frames, false),
      own_frames_(kept == nullptr ? frames : 0) {
  if (kept == nullptr) return;
  for (const auto& [index, frame] : kept->read_frames()) {
    if (index < frames) previous_cuts_[index] = frame.cut;
  }
}

void FrameAssignment::set_cut(const std::string& cut) {
  cut_ = cut;
  for (std::size_t i = 0; i < is_finished_.size(); ++i) is_finished_[i] = !cut.empty() && previous_cuts_[i] == cut;
  resumed_ = static_cast<std::size_t>(std::ranges::count(is_finished_, true));
}

std::size_t FrameAssignment::count() const {
  std::size_t count = 0;
  for (std::size_t i = range_.begin; i < range_.end; ++i) count += is_assigned(i) ? 1 : 0;
  return count;
}

void FrameAssignment::add(std::size_t image, const render::FlightFrame& frame) {
  FrameRecord record{frame.exposure_ms, frame.check, cut_};
  if (store_ == nullptr) {
    own_frames_[image] = std::move(record);
  } else {
    store_->add(image, record);
  }
}

std::vector<FrameRecord> FrameAssignment::collect_frames() const {
  if (store_ == nullptr) return own_frames_;
  const std::map<std::size_t, FrameRecord> kept = store_->read_frames();
  std::vector<FrameRecord> frames;
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < is_finished_.size(); ++i) {
    const auto frame = kept.find(i);
    if (frame == kept.end() || frame->second.cut != cut_) {
      missing.push_back(i);
    } else {
      frames.push_back(frame->second);
    }
  }
  if (missing.empty()) return frames;
  throw InputError(
      store_->dataset_folder().parent_path().string(),
      "has no frames " + describe_frame_ranges(missing) +
          " rendered from the same tiles as the others: the source changed meanwhile; run the same command again");
}

}  // namespace tileflight::recording
