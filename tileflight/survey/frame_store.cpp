#include "tileflight/survey/frame_store.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <system_error>

#include "tileflight/base/files.h"
#include "tileflight/base/input_error.h"
#include "tileflight/base/make_folder.h"
#include "tileflight/dataset/frame_list.h"
#include "tileflight/imaging/fast_png.h"
#include "tileflight/imaging/image_files.h"

namespace tileflight::survey {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

constexpr std::uintmax_t kMaxRecord_bytes = 1 << 20, kMaxTiles_bytes = std::uintmax_t{1} << 30;

/// Opens a file and locks it while the descriptor is open; -1: another process has the lock, or locking failed.
int lock_file(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
  if (descriptor < 0) return -1;
  if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0) return descriptor;
  ::close(descriptor);
  return -1;
}

bool is_rank_alive(const fs::path& rank_file) {
  if (!fs::exists(rank_file)) return false;
  const int descriptor = lock_file(rank_file);
  if (descriptor < 0) return true;
  ::close(descriptor);
  return false;
}

bool any_rank_alive(const fs::path& ranks_folder) {
  std::error_code error;
  for (fs::directory_iterator entry(ranks_folder, error), end; !error && entry != end; entry.increment(error)) {
    if (is_rank_alive(entry->path())) return true;
  }
  return false;
}

json read_json(const fs::path& file, std::uintmax_t max_bytes = kMaxRecord_bytes) {
  try {
    return json::parse(base::read_text(file, max_bytes));
  } catch (const std::exception&) {
    return nullptr;
  }
}

/// The names of the keys that differ: "program, settings".
std::string differences(const json& before, const json& now) {
  std::string names;
  for (const auto& [key, value] : now.items()) {
    if (before.is_object() && before.contains(key) && before[key] == value) continue;
    names += (names.empty() ? "" : ", ") + key;
  }
  return names;
}

json finite_or_null(double value) { return std::isfinite(value) ? json(value) : json(); }

double infinite_if_null(const json& value) {
  return value.is_null() ? std::numeric_limits<double>::infinity() : value.get<double>();
}

json to_json(const FrameRecord& frame) {
  const render::ViewStatistics& view = frame.check.view;
  return {{"exposure_ms", frame.exposure_ms},
          {"surface_share", view.surface_share},
          {"back_share", view.back_face_share},
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
    frame.check.view.surface_share = note.at("surface_share").get<double>();
    frame.check.view.back_face_share = note.at("back_share").get<double>();
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

fs::path FrameStore::folder_for(const fs::path& dataset) {
  fs::path target = fs::absolute(dataset).lexically_normal();
  if (!target.has_filename()) target = target.parent_path();
  return target.parent_path() / ("." + target.filename().string() + ".frames");
}

bool FrameStore::exists(const fs::path& dataset) { return fs::is_directory(folder_for(dataset)); }

std::string FrameStore::prepare(const fs::path& dataset, const json& inputs) {
  const fs::path folder = folder_for(dataset);
  std::string note;
  if (fs::exists(folder)) {
    if (any_rank_alive(folder / "ranks")) throw InputError(dataset.string(), "another process is rendering into it");
    const json before = read_json(folder / "inputs.json");
    if (before != inputs || !fs::is_directory(folder / "dataset")) {
      note = "frames of an earlier render are not reused, because these inputs differ: " + differences(before, inputs);
      std::error_code error;
      fs::remove_all(folder, error);
      if (error) throw InputError(folder.string(), "cannot be removed: " + error.message());
    }
    std::error_code ignored;
    fs::remove_all(folder / "ranks", ignored);
  }
  for (const char* part : {"frames", "ranks", "dataset"}) base::make_folder(folder / part);
  base::write_file(folder / "inputs.json", inputs.dump(1));
  return note;
}

FrameStore::FrameStore(const fs::path& dataset, int rank, int ranks)
    : folder_(folder_for(dataset)),
      rank_(rank),
      ranks_(ranks),
      lock_(lock_file(folder_ / "ranks" / std::to_string(rank))) {
  if (lock_ < 0) throw InputError(folder_.string(), "cannot be written, or another process is rendering into it");
}

FrameStore::~FrameStore() { ::close(lock_); }

void FrameStore::add(std::size_t index, const FrameRecord& frame) const {
  base::write_file(folder_ / "frames" / (dataset::frame_id(index) + ".json"), to_json(frame).dump());
}

void FrameStore::add_picture(std::size_t index, const imaging::RgbImage& picture) const {
  base::make_folder(folder_ / "pictures");
  const std::vector<std::byte> bytes = imaging::encode_png_fast(picture);
  base::write_file(folder_ / "pictures" / (dataset::frame_id(index) + ".png"),
                   {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

imaging::RgbImage FrameStore::read_picture(std::size_t index) const {
  return imaging::read_rgb(folder_ / "pictures" / (dataset::frame_id(index) + ".png"));
}

void FrameStore::add_tiles(const json& records) const {
  base::make_folder(folder_ / "tiles");
  const std::string text = records.dump();
  base::write_file(folder_ / "tiles" / (base::sha256_hex(text) + ".json"), text);
}

std::vector<json> FrameStore::read_tiles() const {
  std::vector<json> records;
  std::error_code error;
  for (fs::directory_iterator entry(folder_ / "tiles", error), end; !error && entry != end; entry.increment(error)) {
    if (entry->path().extension() == ".json") records.push_back(read_json(entry->path(), kMaxTiles_bytes));
  }
  return records;
}

std::map<std::size_t, FrameRecord> FrameStore::read_frames() const {
  std::map<std::size_t, FrameRecord> frames;
  std::error_code error;
  for (fs::directory_iterator entry(folder_ / "frames", error), end; !error && entry != end; entry.increment(error)) {
    const std::optional<std::size_t> index = index_of(entry->path());
    if (!index) continue;
    if (const auto frame = record_from_json(read_json(entry->path()))) frames[*index] = *frame;
  }
  return frames;
}

std::string FrameStore::describe_state(std::size_t frames) const {
  std::string ended;
  for (int r = 0; r < ranks_; ++r) {
    if (r == rank_) continue;
    if (!is_rank_alive(folder_ / "ranks" / std::to_string(r))) {
      ended += (ended.empty() ? "rank " : ", rank ") + std::to_string(r);
    } else if (r < rank_) {
      return "";
    }
  }
  const std::map<std::size_t, FrameRecord> kept = read_frames();
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < frames; ++i) {
    if (!kept.contains(i)) missing.push_back(i);
  }
  const std::string of_all = std::to_string(frames - missing.size()) + " of " + std::to_string(frames) + " frames";
  return (ended.empty() ? "stopped" : ended + " of " + std::to_string(ranks_) + " died") + "; " + of_all +
         " are kept in " + folder_.string() + (missing.empty() ? "" : ", missing: " + describe_frame_ranges(missing)) +
         "; run the same command again to render the missing frames";
}

void FrameStore::remove() const {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

}  // namespace tileflight::survey
