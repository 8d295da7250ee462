#include "tileflight/dataset/segmentation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <unordered_map>
#include <utility>

#include "tileflight/dataset/frame_list.h"
#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/imaging/image_files.h"

// While frames come, ids are not known yet: an object that sorts before all others may be seen in the last one. Until
// then a frame is a file of runs of equal numbers (as they came), which is small, and is coloured in at the end.
namespace tileflight::dataset {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestId = std::numeric_limits<std::uint16_t>::max();

struct Run {
  std::uint32_t number = 0;  ///< 0: nothing, else 1 + number by which the object came
  std::uint32_t pixels = 0;
};

std::vector<Run> runs_of(const imaging::Image<std::uint32_t>& labels) {
  std::vector<Run> runs;
  for (const std::uint32_t label : labels.pixels) {
    if (runs.empty() || runs.back().number != label) runs.push_back({label, 0});
    ++runs.back().pixels;
  }
  return runs;
}

void make_folder(const fs::path& folder) {
  std::error_code error;
  fs::create_directory(folder, error);
  if (error) throw InputError(folder.string(), "cannot be made: " + error.message());
}

/// RFC 4180: quoted where it must be.
std::string csv_field(const std::string& text) {
  if (text.find_first_of(",\"\r\n") == std::string::npos) return text;
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

imaging::GrayImage infrared_of(const imaging::Gray16Image& ids) {
  imaging::GrayImage grey(ids.width, ids.height);
  std::transform(ids.pixels.begin(), ids.pixels.end(), grey.pixels.begin(),
                 [](std::uint16_t id) { return static_cast<std::uint8_t>(id == 0 ? 0 : (id - 1) % 255 + 1); });
  return grey;
}

void write_png(const fs::path& file, const std::vector<std::byte>& bytes) {
  geometry::write_file(file, {reinterpret_cast<const char*>(bytes.data()), bytes.size()});
}

}  // namespace

SegmentationWriter::SegmentationWriter(fs::path dataset_folder, const SegmentationOptions& options)
    : folder_(std::move(dataset_folder)), options_(options) {
  if (options.segmentation) make_folder(folder_ / "segmentation");
  if (options.infrared) make_folder(folder_ / "infrared");
  make_folder(folder_ / "segmentation.runs");
}

fs::path SegmentationWriter::runs_file(std::size_t index) const {
  return folder_ / "segmentation.runs" / frame_id(index);
}

void SegmentationWriter::add(std::size_t index, const imaging::Image<std::uint32_t>& labels,
                             std::span<const SegmentedObject> objects) {
  std::vector<Run> runs = runs_of(labels);
  {
    const std::lock_guard lock(mutex_);
    frames_.push_back(index);
    width_ = labels.width;
    height_ = labels.height;
    std::unordered_map<std::uint32_t, std::uint32_t> number_of;
    for (Run& run : runs) {
      if (run.number == 0) continue;
      const auto [known, is_new] = number_of.try_emplace(run.number, 0);
      if (is_new) {
        const auto number = static_cast<std::uint32_t>(objects_.size()) + 1;
        known->second = objects_.try_emplace(objects[run.number - 1], number).first->second;
      }
      run.number = known->second;
    }
  }
  geometry::write_file(runs_file(index), {reinterpret_cast<const char*>(runs.data()), runs.size() * sizeof(Run)});
}

std::vector<std::uint16_t> SegmentationWriter::final_ids() const {
  if (objects_.size() > kLargestId) {
    throw InputError("segmentation", std::to_string(objects_.size()) +
                                         " objects are seen, but 16 bits tell 65535 apart: leave the output out, or "
                                         "render fewer frames at a time");
  }
  std::vector<std::uint16_t> ids(objects_.size() + 1, 0);
  std::uint16_t id = 0;
  for (const auto& [object, number] : objects_) ids[number] = ++id;
  return ids;
}

void SegmentationWriter::write_frame(std::size_t index, std::span<const std::uint16_t> ids) const {
  const std::vector<std::byte> bytes = geometry::read_bytes(runs_file(index));
  imaging::Gray16Image image(width_, height_);
  auto pixel = image.pixels.begin();
  for (std::size_t at = 0; at < bytes.size(); at += sizeof(Run)) {
    Run run;
    std::memcpy(&run, bytes.data() + at, sizeof run);
    pixel = std::fill_n(pixel, run.pixels, ids[run.number]);
  }
  const std::string file = frame_id(index) + ".png";
  if (options_.segmentation) write_png(folder_ / "segmentation" / file, imaging::encode_png(image));
  if (options_.infrared) write_png(folder_ / "infrared" / file, imaging::encode_png(infrared_of(image)));
}

void SegmentationWriter::write_table() const {
  std::string text = "id,tile,mesh,feature,name\n";
  int id = 0;
  for (const auto& [object, number] : objects_) {
    text += std::to_string(++id) + "," + csv_field(object.tile) + "," + std::to_string(object.mesh) + "," +
            (object.feature ? std::to_string(*object.feature) : "") + "," + csv_field(object.name) + "\n";
  }
  geometry::write_file(folder_ / "segmentation.csv", text);
}

void SegmentationWriter::finish() {
  const std::lock_guard lock(mutex_);
  const std::vector<std::uint16_t> ids = final_ids();
  tbb::parallel_for(std::size_t{0}, frames_.size(), [&](std::size_t i) { write_frame(frames_[i], ids); });
  write_table();
  std::error_code ignored;
  fs::remove_all(folder_ / "segmentation.runs", ignored);
}

}  // namespace tileflight::dataset
