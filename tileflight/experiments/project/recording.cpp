#include "tileflight/experiments/project/recording.h"

#include <string.h>  // strverscmp

#include <algorithm>
#include <functional>
#include <map>

#include "tileflight/capture/ingest/ingest_stage.h"
#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/frame_list.h"
#include "tileflight/data/dataset/ingest.h"
#include "tileflight/data/dataset/sensor_files.h"
#include "tileflight/data/video/video.h"

namespace tileflight::project {
namespace {

namespace fs = std::filesystem;

const std::vector<std::string> kLogEndings{".srt", ".gpx", ".kml", ".csv", ".bin", ".ulg", ".tlog", ".nmea"};
const std::vector<std::string> kImuEndings{".gcsv", ".bbl", ".bfl", ".csv"};
constexpr std::size_t kMostFiles = 500;  // of a folder that is searched

std::string lower_ending(const fs::path& file) { return base::to_lower(file.extension().string()); }

bool may_be_video(const fs::path& file) {
  static const std::vector<std::string> kEndings{".mp4", ".mov", ".mkv", ".avi", ".m4v", ".webm", ".360", ".ts"};
  return std::ranges::count(kEndings, lower_ending(file)) > 0;
}

void examine_videos(const std::vector<fs::path>& videos, Recording& recording) {
  recording.parts = videos;
  std::ranges::stable_sort(recording.parts, [](const fs::path& a, const fs::path& b) {
    return strverscmp(a.filename().c_str(), b.filename().c_str()) < 0;
  });
  ingest::check_chapters(recording.parts);
  const video::VideoInfo first = video::probe_video(recording.parts.front());
  for (const fs::path& part : recording.parts) {
    const video::VideoInfo info = video::probe_video(part);
    if (info.width != first.width || info.height != first.height)
      throw InputError(part.string(), base::formatted("has images of %d x %d pixels, the first part of %d x %d: give "
                                                      "the parts of one recording",
                                                      info.width, info.height, first.width, first.height));
    recording.duration_s += info.duration_s;
    base::add_distinct(info.notes, recording.warnings);
  }
  recording.width = first.width;
  recording.height = first.height;
  recording.pixel_aspect = first.pixel_aspect;
  recording.size_reason = video::describe_size(first);
  recording.frames_per_second = first.frames_per_second;
  recording.part_starts_s = dataset::part_starts_s(recording.parts);
  try {
    recording.own = ingest::read_embedded_telemetry(recording.parts);
  } catch (const InputError& fault) {
    recording.warnings.push_back(std::string("the video's own telemetry is not used: ") + fault.what());
  }
}

/// Throws InputError if photos have several sizes: they are not all by one lens and mode.
void require_one_size(const fs::path& folder, const flight_logs::PhotoLog& photos) {
  std::map<std::string, std::vector<std::string>> names;
  for (const auto& [name, tags] : photos.lenses)
    if (tags.width > 0) names[std::to_string(tags.width) + "x" + std::to_string(tags.height)].push_back(name);
  if (names.size() < 2) return;
  std::vector<std::string> groups;
  for (const auto& [size, of_size] : names)
    groups.push_back(size + " (" + std::to_string(of_size.size()) + ", " + of_size.front() +
                     (of_size.size() > 1 ? " among them)" : ")"));
  throw InputError(folder.string(),
                   "its photos have several sizes: " + base::joined(groups) + "; put those of one size into a folder");
}

void examine_folder(const fs::path& folder, Recording& recording) {
  recording.parts = {folder};
  const fs::path inside = fs::is_directory(folder / "images") ? folder / "images" : folder;
  recording.images = dataset::list_images(inside);
  recording.part_starts_s = {0.0};
  const imaging::RgbImage first = imaging::read_rgb(recording.images.front());
  recording.width = first.width;
  recording.height = first.height;
  recording.photos = flight_logs::read_photo_log(inside);
  require_one_size(inside, recording.photos);
  recording.frames_per_second = 1.0 / dataset::kDefaultFramePeriod_s;
  std::vector<double> times_s, periods_s;
  for (const auto& [name, time] : recording.photos.times) times_s.push_back(time.time_s);
  std::ranges::sort(times_s);
  for (std::size_t i = 1; i < times_s.size(); ++i) periods_s.push_back(times_s[i] - times_s[i - 1]);
  const bool all_have_times = times_s.size() == recording.images.size() && !periods_s.empty();
  if (all_have_times && base::median(periods_s) > 0.0) recording.frames_per_second = 1.0 / base::median(periods_s);
  recording.duration_s = all_have_times ? times_s.back() - times_s.front()
                                        : static_cast<double>(recording.images.size()) / recording.frames_per_second;
}

void set_part(const RecordingFiles& files, Recording& recording) {
  recording.from_s = files.from_s.value_or(0.0);
  recording.to_s = std::min(files.to_s.value_or(recording.duration_s), recording.duration_s);
  if (recording.from_s >= recording.duration_s)
    throw InputError("--from", base::formatted("%.4g s is not within the recording, which lasts %.4g s",
                                               recording.from_s, recording.duration_s));
  if (files.to_s && *files.to_s <= recording.from_s) throw InputError("--to", "must be later than --from");
}

/// Returns the first of the files that `read` takes without an error.
fs::path first_readable(const std::vector<fs::path>& files, const std::function<bool(const fs::path&)>& read) {
  for (const fs::path& file : files) {
    try {
      if (read(file)) return file;
    } catch (const InputError&) {  // it is something else
    }
  }
  return {};
}

/// Returns a clause that says why a file beside the video is taken.
std::string why_beside(const fs::path& file, const fs::path& video) {
  return file.stem() == video.stem() ? "it lies beside the video and has its name"
                                     : "it lies beside the video, the only one in its folder";
}

/// Positions need a height to place anything: without one, the log is not used, with a warning.
void leave_out_positions_without_heights(Recording& recording) {
  const auto has_height = [](const flight_logs::TelemetryFix& fix) {
    return fix.absolute_height_m.has_value() || fix.height_above_takeoff_m.has_value();
  };
  if (!recording.has_positions() || std::ranges::any_of(recording.telemetry.fixes, has_height)) return;
  recording.warnings.push_back(recording.telemetry_source.string() +
                               ": its positions have no heights, so they are not used; give a log that has them "
                               "(--telemetry)");
  recording.telemetry.fixes.clear();
  recording.telemetry_source.clear();
  recording.choices.back() = {"real.ingest", "telemetry", "", "the positions that were found have no heights"};
}

void choose_telemetry(const RecordingFiles& files, Recording& recording) {
  const fs::path& video = recording.parts.front();
  const auto take = [&](const fs::path& file) {
    recording.telemetry = ingest::read_flight_log(file);
    return !recording.telemetry.fixes.empty();
  };
  if (!files.telemetry.empty()) {
    take(files.telemetry);
    recording.telemetry_source = files.telemetry;
    recording.choices.push_back({"real.ingest", "telemetry", files.telemetry.string(), "it was given"});
  } else if (recording.own && !recording.own->telemetry.fixes.empty()) {
    recording.telemetry = recording.own->telemetry;
    recording.telemetry_source = video;
    recording.choices.push_back(
        {"real.ingest", "telemetry", "", "the positions are those of " + recording.own->kind + " in the video"});
  } else if (!recording.photos.telemetry.fixes.empty()) {
    recording.telemetry = recording.photos.telemetry;
    recording.telemetry_source = video;
    recording.choices.push_back({"real.ingest", "telemetry", "", "the positions are those of the photos' tags"});
  } else if (const fs::path file = first_readable(files_beside(video, kLogEndings), take); !file.empty()) {
    recording.telemetry_source = file;
    recording.choices.push_back(
        {"real.ingest", "telemetry", file.string(), why_beside(file, video), Certainty::kLikely});
  } else {
    recording.telemetry = {};
    recording.choices.push_back(
        {"real.ingest", "telemetry", "", "no positions were found in the recording or beside it", Certainty::kLikely});
  }
  leave_out_positions_without_heights(recording);
  const bool has_own_file = !recording.telemetry_source.empty() && recording.telemetry_source != video;
  // Subtitles state times of their video; other logs run by a clock of their own.
  recording.has_video_clock = !has_own_file || lower_ending(recording.telemetry_source) == ".srt";
  if (has_own_file)
    recording.choices.push_back(
        recording.has_video_clock
            ? Choice{"real.ingest", "telemetry_offset", "0", "subtitles have the times of their video"}
            : Choice{"real.ingest", "telemetry_offset", "auto",
                     "the log has a clock of its own; its offset is found from the motion in both",
                     Certainty::kLikely});
}

void choose_imu(const RecordingFiles& files, Recording& recording) {
  const fs::path& video = recording.parts.front();
  const auto is_log = [](const fs::path& file) {
    std::vector<std::string> notes;
    return !dataset::read_imu_csv(file, notes).empty();
  };
  if (!files.imu.empty()) {
    recording.choices.push_back({"real.ingest", "imu", files.imu.string(), "it was given"});
  } else if (recording.own && !recording.own->telemetry.inertial.empty()) {
    recording.choices.push_back(
        {"real.ingest", "imu", "", "the readings are those of " + recording.own->kind + " in the video"});
  } else if (const fs::path file = first_readable(files_beside(video, kImuEndings), is_log); !file.empty()) {
    recording.choices.push_back({"real.ingest", "imu", file.string(), why_beside(file, video), Certainty::kLikely});
  }
}

}  // namespace

std::vector<fs::path> files_beside(const fs::path& video, const std::vector<std::string>& endings) {
  std::vector<fs::path> same_name, others;
  std::size_t videos = 0, files = 0;
  std::error_code fault;
  const fs::path folder = fs::absolute(video).parent_path();
  for (fs::directory_iterator it(folder, fault), end; !fault && it != end && files < kMostFiles; it.increment(fault)) {
    if (!it->is_regular_file(fault)) continue;
    ++files;
    const fs::path& file = it->path();
    if (may_be_video(file)) ++videos;
    if (std::ranges::count(endings, lower_ending(file)) == 0) continue;
    (file.stem() == video.stem() ? same_name : others).push_back(file);
  }
  std::ranges::sort(same_name);
  std::ranges::sort(others);
  if (videos <= 1 && !fs::is_directory(video)) same_name.insert(same_name.end(), others.begin(), others.end());
  return same_name;
}

Recording examine_files(const RecordingFiles& files) {
  if (files.videos.empty()) throw InputError("--video", "is missing: give the recording");
  Recording recording;
  const bool has_folder =
      std::ranges::any_of(files.videos, [](const fs::path& file) { return fs::is_directory(file); });
  if (has_folder && files.videos.size() > 1)
    throw InputError("--video", "takes the parts of one video, or one folder of photos");
  for (const fs::path& file : files.videos)
    if (!fs::exists(file)) throw InputError(file.string(), "no such video file or image folder");
  if (has_folder) {
    examine_folder(files.videos.front(), recording);
  } else {
    examine_videos(files.videos, recording);
  }
  const std::string size = base::formatted("%d x %d pixels at %.4g a second, %.1f s", recording.width, recording.height,
                                           recording.frames_per_second, recording.duration_s);
  std::string names;
  for (const fs::path& part : recording.parts) names += (names.empty() ? "" : ", ") + part.string();
  recording.choices.push_back(
      {"real.ingest", "video", recording.parts.size() == 1 ? names : "[" + names + "]",
       (recording.is_folder() ? std::to_string(recording.images.size()) + " images of " : "images of ") + size});
  set_part(files, recording);
  choose_telemetry(files, recording);
  choose_imu(files, recording);
  return recording;
}

}  // namespace tileflight::project
