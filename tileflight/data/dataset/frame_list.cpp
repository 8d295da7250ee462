#include "tileflight/data/dataset/frame_list.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string_view>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/image_files.h"

namespace tileflight::dataset {

namespace {

namespace fs = std::filesystem;

bool is_image(const fs::path& file) {
  return imaging::is_image_name(file) && !file.filename().string().starts_with('.');
}

struct TimesLine {
  int number = 0;
  std::string id;  ///< empty: bare seconds
  double time_s = 0.0;
  double exposure_ms = 0.0;
};

TimesLine parse_line(const base::TextRow& row) {
  const std::vector<std::string_view>& fields = row.fields;
  TimesLine line;
  line.number = row.line;
  if (fields.size() > 3) throw InputError(row.where, "expected \"id seconds [exposure_ms]\" or bare seconds");
  if (fields.size() > 1) line.id = fields[0];
  line.time_s = base::require_finite(row.where + ", time", fields[fields.size() > 1 ? 1 : 0]);
  if (fields.size() == 3) line.exposure_ms = base::require_finite(row.where + ", exposure", fields[2]);
  if (line.exposure_ms < 0.0) throw InputError(row.where, "the exposure is negative");
  return line;
}

std::vector<TimesLine> read_times(const fs::path& file) {
  std::vector<TimesLine> lines;
  base::for_each_row(base::read_text(file), file.string(), " \t", [&](const base::TextRow& row) {
    lines.push_back(parse_line(row));
    if (lines.back().id.empty() != lines.front().id.empty())
      throw InputError(row.where, "some lines have a frame name and others do not");
  });
  if (lines.empty()) throw InputError(file.string(), "has no times");
  return lines;
}

/// Assigns bare seconds to the images in order.
std::vector<Frame> match_by_order(const std::vector<fs::path>& images, const std::vector<TimesLine>& lines,
                                  const fs::path& file, std::vector<std::string>& warnings) {
  if (images.size() != lines.size())
    throw InputError(file.string(), "has " + std::to_string(lines.size()) + " times for " +
                                        std::to_string(images.size()) +
                                        " images: without frame names, give one time for each image");
  note_order_by_numbers(images, warnings);
  std::vector<Frame> frames;
  for (std::size_t i = 0; i < images.size(); ++i)
    frames.push_back({images[i].stem().string(), images[i], lines[i].time_s, lines[i].exposure_ms});
  return frames;
}

std::vector<Frame> match_by_name(const std::vector<fs::path>& images, const std::vector<TimesLine>& lines,
                                 const fs::path& file, std::vector<std::string>& warnings) {
  std::map<std::string, fs::path> by_name;
  for (const fs::path& image : images) by_name.emplace(image.stem().string(), image);
  std::vector<Frame> frames;
  for (const TimesLine& line : lines) {
    const auto image = by_name.find(line.id);
    if (image == by_name.end())
      throw InputError(file.string() + ": line " + std::to_string(line.number),
                       "frame \"" + line.id + "\" has no image in " + images.front().parent_path().string());
    frames.push_back({line.id, image->second, line.time_s, line.exposure_ms});
  }
  if (images.size() > lines.size())
    warnings.push_back(file.string() + ": " + std::to_string(images.size() - lines.size()) +
                       " images have no time and are skipped");
  return frames;
}

}  // namespace

std::string frame_id(std::size_t index) {
  const std::string digits = std::to_string(index);
  return std::string(digits.size() < 6 ? 6 - digits.size() : 0, '0') + digits;
}

std::vector<fs::path> list_images(const fs::path& folder) {
  std::vector<fs::path> images;
  std::error_code error;
  for (fs::directory_iterator entry(folder, error), end; !error && entry != end; entry.increment(error))
    if (is_image(entry->path())) images.push_back(entry->path());
  if (error) throw InputError(folder.string(), "cannot be listed: " + error.message());
  if (images.empty()) throw InputError(folder.string(), "has no images (.jpg, .png, .webp, .tif, .bmp, .pgm or .ppm)");
  std::ranges::sort(images, [](const fs::path& a, const fs::path& b) {
    return base::natural_less(a.filename().string(), b.filename().string());
  });
  return images;
}

void note_order_by_numbers(const std::vector<fs::path>& images, std::vector<std::string>& notes) {
  const auto unsorted = std::ranges::is_sorted_until(images);
  if (unsorted == images.end()) return;
  notes.push_back(images.front().parent_path().string() +
                  ": the images are taken in the order of the numbers in their names (" +
                  (unsorted - 1)->filename().string() + " before " + unsorted->filename().string() + ")");
}

void warn_of_order(const std::vector<Frame>& frames, const std::string& where, std::vector<std::string>& warnings) {
  const auto name_of = [](const Frame& frame) { return frame.image.filename().string(); };
  std::size_t later = 0;
  while (later + 1 < frames.size() && !base::natural_less(name_of(frames[later + 1]), name_of(frames[later]))) ++later;
  if (later + 1 >= frames.size()) return;
  warnings.push_back(where + ": the names of the images and their times are in different orders (" +
                     name_of(frames[later]) + " is earlier than " + name_of(frames[later + 1]) + "); the times decide");
}

std::vector<Frame> read_timed_frames(const std::vector<fs::path>& images, const fs::path& times_file,
                                     std::vector<std::string>& warnings) {
  std::vector<TimesLine> lines = read_times(times_file);
  if (const base::TimeUnit unit = base::guess_time_unit(lines.front().time_s); unit.seconds != 1.0) {
    for (TimesLine& line : lines) line.time_s *= unit.seconds;
    warnings.push_back(times_file.string() + ": the times are taken as " + unit.name +
                       ", as seconds they would be dates after the year 5000");
  }
  std::vector<Frame> frames = lines.front().id.empty() ? match_by_order(images, lines, times_file, warnings)
                                                       : match_by_name(images, lines, times_file, warnings);
  require_increasing_times(frames, times_file);
  warn_of_order(frames, times_file.string(), warnings);
  return frames;
}

std::vector<Frame> make_uniform_frames(const std::vector<fs::path>& images, double period_s) {
  std::vector<Frame> frames;
  for (const fs::path& image : images)
    frames.push_back({image.stem().string(), image, static_cast<double>(frames.size()) * period_s, 0.0});
  return frames;
}

void require_increasing_times(const std::vector<Frame>& frames, const fs::path& file) {
  for (std::size_t i = 1; i < frames.size(); ++i)
    if (!(frames[i].time_s > frames[i - 1].time_s))
      throw InputError(file.string(), "the time of frame \"" + frames[i].id + "\" is not after the one before it");
}

}  // namespace tileflight::dataset
