#include "tileflight/data/flight_logs/photo_log.h"

#include <algorithm>
#include <cctype>
#include <fstream>

#include "tileflight/core/base/input_error.h"
#include "tileflight/data/flight_logs/fix_filter.h"
#include "tileflight/data/flight_logs/photo_tags.h"

namespace tileflight::flight_logs {
namespace {

namespace fs = std::filesystem;

/// The tags are in the first segments, of at most 64 KB each.
constexpr std::size_t kHeadBytes = std::size_t{1} << 19;

struct Photo {
  std::string name;
  PhotoTags tags;
  double time_s = 0.0;  ///< since 1970
};

bool is_jpeg(const fs::path& file) {
  std::string ending = file.extension().string();
  std::transform(ending.begin(), ending.end(), ending.begin(), [](unsigned char c) { return std::tolower(c); });
  return ending == ".jpg" || ending == ".jpeg";
}

std::vector<std::byte> head_of(const fs::path& file) {
  std::vector<std::byte> bytes(kHeadBytes);
  std::ifstream in(file, std::ios::binary);
  if (!in) throw InputError(file.string(), "cannot be read");
  in.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  bytes.resize(static_cast<std::size_t>(in.gcount()));
  return bytes;
}

std::vector<Photo> photos_of(const fs::path& folder) {
  if (!fs::is_directory(folder)) throw InputError(folder.string(), "no such folder of photos");
  std::vector<Photo> photos;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.is_regular_file() && is_jpeg(entry.path()))
      photos.push_back({entry.path().filename().string(), read_photo_tags(head_of(entry.path()))});
  }
  std::sort(photos.begin(), photos.end(), [](const Photo& a, const Photo& b) { return a.name < b.name; });
  return photos;
}

/// Sorts by time and spreads photos with the same time over the second, or up to the next photo.
std::size_t spread(std::vector<Photo>& photos) {
  std::stable_sort(photos.begin(), photos.end(),
                   [](const Photo& a, const Photo& b) { return *a.tags.taken_at_s < *b.tags.taken_at_s; });
  std::size_t moved = 0;
  for (std::size_t begin = 0, end = 0; begin < photos.size(); begin = end) {
    const double time_s = *photos[begin].tags.taken_at_s;
    while (end < photos.size() && *photos[end].tags.taken_at_s == time_s) ++end;
    const double room_s = end < photos.size() ? std::min(1.0, *photos[end].tags.taken_at_s - time_s) : 1.0;
    for (std::size_t i = begin; i < end; ++i)
      photos[i].time_s = time_s + room_s * static_cast<double>(i - begin) / static_cast<double>(end - begin);
    moved += end - begin - 1;
  }
  return moved;
}

TelemetryFix fix_of(const Photo& photo, double time_s) {
  const PhotoTags& tags = photo.tags;
  TelemetryFix fix;
  fix.time_s = time_s;
  fix.latitude_deg = *tags.latitude_deg;
  fix.longitude_deg = *tags.longitude_deg;
  fix.absolute_height_m = tags.absolute_height_m;
  fix.height_above_takeoff_m = tags.height_above_takeoff_m;
  fix.gimbal_yaw_deg = tags.gimbal_yaw_deg;
  fix.gimbal_pitch_deg = tags.gimbal_pitch_deg;
  fix.gimbal_roll_deg = tags.gimbal_roll_deg;
  fix.body_yaw_deg = tags.body_yaw_deg;
  fix.body_pitch_deg = tags.body_pitch_deg;
  fix.body_roll_deg = tags.body_roll_deg;
  return fix;
}

Telemetry telemetry_of(const std::vector<Photo>& photos) {
  FixFilter filter;
  bool all_ellipsoidal = true;
  for (const Photo& photo : photos) {
    if (!photo.tags.latitude_deg || !photo.tags.longitude_deg) {
      filter.drop_without_fix();
      continue;
    }
    filter.add(fix_of(photo, photo.time_s - photos.front().time_s));
    all_ellipsoidal = all_ellipsoidal && photo.tags.height_is_ellipsoidal;
  }
  Telemetry telemetry = std::move(filter).finish();
  drop_fixes_without_height(telemetry);
  telemetry.height_datum = all_ellipsoidal ? HeightDatum::kEllipsoid : HeightDatum::kMeanSeaLevel;
  return telemetry;
}

}  // namespace

PhotoLog read_photo_log(const fs::path& folder) {
  std::vector<Photo> photos = photos_of(folder);
  PhotoLog log;
  log.photos = photos.size();
  std::erase_if(photos, [](const Photo& photo) { return !photo.tags.taken_at_s; });
  if (photos.empty()) return log;
  if (const std::size_t moved = spread(photos); moved > 0) {
    log.warnings.push_back(std::to_string(moved) +
                           " photos have the same time as the one before; they are spread evenly over that second");
  }
  const auto turned =
      std::count_if(photos.begin(), photos.end(), [](const Photo& p) { return p.tags.orientation > 1; });
  if (turned > 0) {
    log.warnings.push_back(
        std::to_string(turned) +
        " photos have a rotation flag, which is ignored: they are used as stored, like the images of a calibration");
  }
  log.start_utc_s = photos.front().time_s;
  for (const Photo& photo : photos)
    log.times[photo.name] = {photo.time_s - photos.front().time_s, 1e3 * photo.tags.exposure_s.value_or(0.0)};
  log.telemetry = telemetry_of(photos);
  return log;
}

}  // namespace tileflight::flight_logs
