#include "tileflight/data/dataset/segmentation.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cstring>
#include <limits>
#include <unordered_map>
#include <utility>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/base/text_parsing.h"
#include "tileflight/core/imaging/image_files.h"
#include "tileflight/data/dataset/frame_list.h"

// While frames are added, ids are not known yet: an object that sorts before all others may appear in the last frame.
// Until then each frame is stored as a small file with its visible objects and run-length encoded labels, and its image
// is written at the end. Nothing is kept in memory, so frames may come from several processes and at different times.
namespace tileflight::dataset {
namespace {

namespace fs = std::filesystem;

constexpr std::size_t kLargestId = std::numeric_limits<std::uint16_t>::max();

struct Run {
  std::uint32_t label = 0;  ///< 0: no object, else 1 + index into the objects of its frame
  std::uint32_t pixels = 0;
};

/// Content of a frame's file.
struct RunLengthFrame {
  int width = 0, height = 0;
  std::vector<SegmentedObject> objects;  ///< objects visible in the frame, in order of appearance
  std::vector<Run> runs;                 ///< row by row; labels are 1 + index into `objects`
};

RunLengthFrame encode_runs(const imaging::Image<std::uint32_t>& labels, std::span<const SegmentedObject> objects) {
  RunLengthFrame frame{labels.width, labels.height, {}, {}};
  std::unordered_map<std::uint32_t, std::uint32_t> number_of{{0, 0}};
  const std::uint32_t* before = nullptr;
  for (const std::uint32_t& label : labels.pixels) {
    if (before != nullptr && *before == label) {
      ++frame.runs.back().pixels;
      continue;
    }
    before = &label;
    const auto [known, is_new] = number_of.try_emplace(label, static_cast<std::uint32_t>(frame.objects.size()) + 1);
    if (is_new) frame.objects.push_back(objects[label - 1]);
    frame.runs.push_back({known->second, 1});
  }
  return frame;
}

template <class T>
void append(std::string& bytes, const T& value) {
  bytes.append(reinterpret_cast<const char*>(&value), sizeof value);
}

void append_text(std::string& bytes, const std::string& text) {
  append(bytes, static_cast<std::uint32_t>(text.size()));
  bytes += text;
}

std::string to_bytes(const RunLengthFrame& frame) {
  std::string bytes;
  append(bytes, frame.width);
  append(bytes, frame.height);
  append(bytes, static_cast<std::uint32_t>(frame.objects.size()));
  for (const SegmentedObject& object : frame.objects) {
    append_text(bytes, object.tile);
    append(bytes, object.mesh);
    append(bytes, static_cast<std::uint8_t>(object.feature.has_value()));
    append(bytes, object.feature.value_or(0));
    append_text(bytes, object.name);
  }
  for (const Run& run : frame.runs) append(bytes, run);
  return bytes;
}

/// Reads the output of to_bytes; a truncated file is an InputError.
class FrameReader {
 public:
  explicit FrameReader(const fs::path& file) : file_(file), bytes_(base::read_raw(file)) {}

  RunLengthFrame read() {
    RunLengthFrame frame = read_head();
    while (at_ < bytes_.size()) frame.runs.push_back(take<Run>());
    return frame;
  }
  /// Reads everything except the runs.
  RunLengthFrame read_head() {
    RunLengthFrame frame;
    frame.width = take<int>();
    frame.height = take<int>();
    const auto count = take<std::uint32_t>();
    for (std::uint32_t i = 0; i < count; ++i) {
      SegmentedObject& object = frame.objects.emplace_back();
      object.tile = take_text();
      object.mesh = take<std::uint32_t>();
      const bool has_feature = take<std::uint8_t>() != 0;
      const auto feature = take<std::uint32_t>();
      if (has_feature) object.feature = feature;
      object.name = take_text();
    }
    return frame;
  }

 private:
  void require(std::size_t count) const {
    if (count > bytes_.size() - at_) throw InputError(file_.string(), "is truncated; render the frames again");
  }
  template <class T>
  T take() {
    require(sizeof(T));
    T value;
    std::memcpy(&value, bytes_.data() + at_, sizeof value);
    at_ += sizeof value;
    return value;
  }
  std::string take_text() {
    const auto size = take<std::uint32_t>();
    require(size);
    at_ += size;
    return bytes_.substr(at_ - size, size);
  }

  fs::path file_;
  std::string bytes_;
  std::size_t at_ = 0;
};

imaging::GrayImage to_infrared(const imaging::Gray16Image& ids) {
  imaging::GrayImage grey(ids.width, ids.height);
  std::transform(ids.pixels.begin(), ids.pixels.end(), grey.pixels.begin(),
                 [](std::uint16_t id) { return static_cast<std::uint8_t>(id == 0 ? 0 : (id - 1) % 255 + 1); });
  return grey;
}

}  // namespace

SegmentationWriter::SegmentationWriter(fs::path dataset_folder, const SegmentationOptions& options)
    : folder_(std::move(dataset_folder)),
      runs_folder_(options.runs_folder.empty() ? folder_ / "segmentation.runs" : options.runs_folder),
      options_(options) {
  if (options.segmentation) base::make_folder(folder_ / "segmentation");
  if (options.infrared) base::make_folder(folder_ / "infrared");
  base::make_folder(runs_folder_);
}

void SegmentationWriter::add(std::size_t index, const imaging::Image<std::uint32_t>& labels,
                             std::span<const SegmentedObject> objects) const {
  base::write_file(runs_folder_ / frame_id(index), to_bytes(encode_runs(labels, objects)));
}

std::vector<std::string> SegmentationWriter::list_frames() const {
  std::vector<std::string> names;
  for (const auto& entry : fs::directory_iterator(runs_folder_)) {
    const std::string name = entry.path().filename().string();
    if (!name.starts_with(".")) names.push_back(name);  // else: a partial file of a killed process
  }
  return names;
}

SegmentationWriter::Ids SegmentationWriter::assign_ids(const std::vector<std::string>& frames) const {
  Ids ids;
  for (const std::string& frame : frames) {
    for (const SegmentedObject& object : FrameReader(runs_folder_ / frame).read_head().objects) ids.emplace(object, 0);
  }
  if (ids.size() > kLargestId) {
    throw InputError("segmentation", std::to_string(ids.size()) +
                                         " objects are visible, more than the 65535 of a 16-bit image: leave this "
                                         "output out, or render fewer frames at a time");
  }
  std::uint16_t id = 0;
  for (auto& [object, number] : ids) number = ++id;
  return ids;
}

void SegmentationWriter::write_frame(const std::string& name, const Ids& ids) const {
  const RunLengthFrame frame = FrameReader(runs_folder_ / name).read();
  std::vector<std::uint16_t> id_of{0};
  for (const SegmentedObject& object : frame.objects) id_of.push_back(ids.at(object));
  imaging::Gray16Image image(frame.width, frame.height);
  auto pixel = image.pixels.begin();
  for (const Run& run : frame.runs) {
    if (run.label >= id_of.size() || run.pixels > image.pixels.end() - pixel)
      throw InputError((runs_folder_ / name).string(), "is damaged; render the frames again");
    pixel = std::fill_n(pixel, run.pixels, id_of[run.label]);
  }
  const std::string file = name + ".png";
  if (options_.segmentation)
    base::write_file(folder_ / "segmentation" / file, base::as_text(imaging::encode_png(image)));
  if (options_.infrared)
    base::write_file(folder_ / "infrared" / file, base::as_text(imaging::encode_png(to_infrared(image))));
}

void SegmentationWriter::write_table(const Ids& ids) const {
  std::string text = "id,tile,mesh,feature,name\n";
  for (const auto& [object, id] : ids) {
    text += std::to_string(id) + "," + base::csv_field(object.tile) + "," + std::to_string(object.mesh) + "," +
            (object.feature ? std::to_string(*object.feature) : "") + "," + base::csv_field(object.name) + "\n";
  }
  base::write_file(folder_ / "segmentation.csv", text);
}

void SegmentationWriter::finish() const {
  const std::vector<std::string> names = list_frames();
  const Ids ids = assign_ids(names);
  tbb::parallel_for(std::size_t{0}, names.size(), [&](std::size_t i) { write_frame(names[i], ids); });
  write_table(ids);
  if (!options_.runs_folder.empty()) return;
  std::error_code ignored;
  fs::remove_all(runs_folder_, ignored);
}

}  // namespace tileflight::dataset
