#include "tileflight/experiment/kept_frames.h"

#include <fcntl.h>
#include <sys/file.h>
#include <unistd.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <system_error>

#include "tileflight/dataset/frame_list.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/imaging/image_files.h"
#include "tileflight/imaging/quick_png.h"

namespace tileflight::experiment {
namespace fs = std::filesystem;
namespace {

using nlohmann::json;

constexpr std::uintmax_t kMaxNote_bytes = 1 << 20;

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) throw InputError(folder.string(), "cannot be made: " + error.message());
}

/// Opens a file and locks it for as long as the descriptor is open; -1: another process has the lock, or it cannot be.
int locked(const fs::path& file) {
  const int descriptor = ::open(file.c_str(), O_CREAT | O_RDWR | O_CLOEXEC, 0666);
  if (descriptor < 0) return -1;
  if (::flock(descriptor, LOCK_EX | LOCK_NB) == 0) return descriptor;
  ::close(descriptor);
  return -1;
}

bool lives(const fs::path& rank_file) {
  if (!fs::exists(rank_file)) return false;
  const int descriptor = locked(rank_file);
  if (descriptor < 0) return true;
  ::close(descriptor);
  return false;
}

bool anyone_lives(const fs::path& ranks_folder) {
  std::error_code error;
  for (fs::directory_iterator entry(ranks_folder, error), end; !error && entry != end; entry.increment(error)) {
    if (lives(entry->path())) return true;
  }
  return false;
}

json read_json(const fs::path& file) {
  try {
    return json::parse(geometry::read_text(file, kMaxNote_bytes));
  } catch (const std::exception&) {
    return nullptr;
  }
}

/// The names of what differs, "program, settings".
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

json to_json(const KeptFrame& frame) {
  const sensors::FrameView& view = frame.check.view;
  return {{"exposure_ms", frame.exposure_ms},
          {"surface_share", view.surface_share},
          {"back_share", view.back_share},
          {"nearest_m", finite_or_null(view.nearest_m)},
          {"clearance_m", finite_or_null(frame.check.around.clearance_m)},
          {"above_ground_m", finite_or_null(frame.check.around.above_ground_m)},
          {"inside", frame.check.around.inside},
          {"path_is_blocked", frame.check.path_is_blocked},
          {"cut", frame.cut}};
}

std::optional<KeptFrame> frame_from(const json& note) {
  try {
    KeptFrame frame;
    frame.exposure_ms = note.at("exposure_ms").get<double>();
    frame.check.view.surface_share = note.at("surface_share").get<double>();
    frame.check.view.back_share = note.at("back_share").get<double>();
    frame.check.view.nearest_m = infinite_if_null(note.at("nearest_m"));
    frame.check.around.clearance_m = infinite_if_null(note.at("clearance_m"));
    frame.check.around.above_ground_m = infinite_if_null(note.at("above_ground_m"));
    frame.check.around.inside = note.at("inside").get<bool>();
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

std::vector<std::optional<sensors::FrameCheck>> checks_of(const std::vector<KeptFrame>& frames) {
  std::vector<std::optional<sensors::FrameCheck>> checks;
  for (const KeptFrame& frame : frames) checks.emplace_back(frame.check);
  return checks;
}

std::string frame_ranges(const std::vector<std::size_t>& frames) {
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

fs::path KeptFrames::folder_of(const fs::path& dataset) {
  fs::path target = fs::absolute(dataset).lexically_normal();
  if (!target.has_filename()) target = target.parent_path();
  return target.parent_path() / ("." + target.filename().string() + ".frames");
}

bool KeptFrames::are_there(const fs::path& dataset) { return fs::is_directory(folder_of(dataset)); }

std::string KeptFrames::prepare(const fs::path& dataset, const json& inputs) {
  const fs::path folder = folder_of(dataset);
  std::string note;
  if (fs::exists(folder)) {
    if (anyone_lives(folder / "ranks")) throw InputError(dataset.string(), "another process renders into it");
    const json before = read_json(folder / "inputs.json");
    if (before != inputs || !fs::is_directory(folder / "dataset")) {
      note = "frames that an earlier render left are not used: it had others of " + differences(before, inputs);
      std::error_code error;
      fs::remove_all(folder, error);
      if (error) throw InputError(folder.string(), "cannot be removed: " + error.message());
    }
    std::error_code ignored;
    fs::remove_all(folder / "ranks", ignored);
  }
  for (const char* part : {"frames", "ranks", "dataset"}) make_folder(folder / part);
  geometry::write_file(folder / "inputs.json", inputs.dump(1));
  return note;
}

KeptFrames::KeptFrames(const fs::path& dataset, int rank, int ranks)
    : folder_(folder_of(dataset)), rank_(rank), ranks_(ranks), lock_(locked(folder_ / "ranks" / std::to_string(rank))) {
  if (lock_ < 0) throw InputError(folder_.string(), "cannot be written, or another process renders into it");
}

KeptFrames::~KeptFrames() { ::close(lock_); }

void KeptFrames::add(std::size_t index, const KeptFrame& frame) const {
  geometry::write_file(folder_ / "frames" / (dataset::frame_id(index) + ".json"), to_json(frame).dump());
}

void KeptFrames::add_picture(std::size_t index, const imaging::RgbImage& picture) const {
  make_folder(folder_ / "pictures");
  const std::vector<std::byte> bytes = imaging::encode_quick_png(picture);
  geometry::write_file(folder_ / "pictures" / (dataset::frame_id(index) + ".png"),
                       {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

imaging::RgbImage KeptFrames::picture(std::size_t index) const {
  return imaging::read_rgb(folder_ / "pictures" / (dataset::frame_id(index) + ".png"));
}

std::map<std::size_t, KeptFrame> KeptFrames::all() const {
  std::map<std::size_t, KeptFrame> frames;
  std::error_code error;
  for (fs::directory_iterator entry(folder_ / "frames", error), end; !error && entry != end; entry.increment(error)) {
    const std::optional<std::size_t> index = index_of(entry->path());
    if (!index) continue;
    if (const auto frame = frame_from(read_json(entry->path()))) frames[*index] = *frame;
  }
  return frames;
}

std::string KeptFrames::state(std::size_t frames) const {
  std::string ended;
  for (int r = 0; r < ranks_; ++r) {
    if (r == rank_) continue;
    if (!lives(folder_ / "ranks" / std::to_string(r))) {
      ended += (ended.empty() ? "rank " : ", rank ") + std::to_string(r);
    } else if (r < rank_) {
      return "";
    }
  }
  const std::map<std::size_t, KeptFrame> kept = all();
  std::vector<std::size_t> missing;
  for (std::size_t i = 0; i < frames; ++i) {
    if (!kept.contains(i)) missing.push_back(i);
  }
  const std::string of_all = std::to_string(frames - missing.size()) + " of " + std::to_string(frames) + " frames";
  return (ended.empty() ? "stopped" : ended + " of " + std::to_string(ranks_) + " died") + "; " + of_all +
         " are kept in " + folder_.string() + (missing.empty() ? "" : ", missing: " + frame_ranges(missing)) +
         "; the same command again renders what is missing";
}

void KeptFrames::remove() const {
  std::error_code ignored;
  fs::remove_all(folder_, ignored);
}

}  // namespace tileflight::experiment
