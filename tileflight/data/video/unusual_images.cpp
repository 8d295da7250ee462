#include "tileflight/data/video/unusual_images.h"

#include <algorithm>
#include <cmath>

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/order_statistics.h"
#include "tileflight/data/video/high_dynamic_range.h"
#include "tileflight/data/video/video.h"

namespace tileflight::video {

namespace {

std::string size_of(const AVStream& stream) {
  return std::to_string(stream.codecpar->width) + "x" + std::to_string(stream.codecpar->height);
}

std::string turned_text(const AVStream& stream, int quarter_turns) {
  std::string text =
      base::formatted("its images are turned by %d degrees clockwise, as its rotation flag says", 90 * quarter_turns);
  if (quarter_turns % 2 == 1)
    text += base::formatted(", and become %dx%d", stream.codecpar->height, stream.codecpar->width);
  return text + ": the calibration must be of turned images; a rolling shutter's rows run " +
         (quarter_turns == 2 ? "from the bottom up" : "as columns, which no line delay describes");
}

std::string wide_pixels_text(const AVStream& stream, double aspect) {
  return base::formatted(
             "its pixels are not square but %.4g times as wide as high; its images are used as they are stored, ",
             aspect) +
         size_of(stream) + base::formatted(": the calibration must be of such images (fx is about fy / %.4g)", aspect);
}

bool is_interlaced(AVFieldOrder order) {
  return order == AV_FIELD_TT || order == AV_FIELD_BB || order == AV_FIELD_TB || order == AV_FIELD_BT;
}

std::string several_text(const AVFormatContext& input, const AVStream& chosen) {
  std::vector<std::string> sizes;
  std::size_t number = 0;
  for (unsigned i = 0; i < input.nb_streams; ++i) {
    if (!libav::is_moving_image(*input.streams[i])) continue;
    sizes.push_back(size_of(*input.streams[i]));
    if (input.streams[i] == &chosen) number = sizes.size();
  }
  if (sizes.size() < 2 || number == 0) return {};
  return base::formatted("it holds %zu videos (", sizes.size()) + base::joined(sizes) +
         base::formatted(
             "): number %zu is used; for another one, copy it into a file of its own: ffmpeg -i IN -map "
             "0:v:N -c copy OUT, N from 0",
             number);
}

}  // namespace

std::string describe_size(const VideoInfo& info) {
  std::string text;
  if (info.quarter_turns % 2 == 1)
    text = base::formatted("its images are %dx%d as they are stored, and its rotation flag turns them to %dx%d",
                           info.height, info.width, info.width, info.height);
  if (info.pixel_aspect == 1.0) return text;
  return (text.empty() ? "its images" : text + ", and they") +
         base::formatted(
             " are shown as %dx%d, since their pixels are not square: in a calibration of that size, change "
             "the width to %d and multiply fx and cx by %.4g",
             static_cast<int>(std::lround(info.width * info.pixel_aspect)), info.height, info.width,
             1.0 / info.pixel_aspect);
}

double pixel_aspect_of(AVFormatContext& input, AVStream& stream) {
  constexpr double kRounding = 0.005;
  const AVRational stated = av_guess_sample_aspect_ratio(&input, &stream, nullptr);
  if (stated.num <= 0 || stated.den <= 0) return 1.0;
  const double aspect = av_q2d(stated);
  return std::abs(aspect - 1.0) < kRounding ? 1.0 : aspect;
}

std::string interlaced_text() {
  return "its images are interlaced: odd and even rows are of two moments, so that edges which move become combs, and "
         "odometry tracks them badly; make an image of each field first: ffmpeg -i IN -vf bwdif=mode=send_field -c:v "
         "libx264 -crf 16 OUT";
}

std::vector<std::string> describe_unusual_images(AVFormatContext& input, AVStream& stream, int quarter_turns) {
  std::vector<std::string> notes;
  if (quarter_turns != 0) notes.push_back(turned_text(stream, quarter_turns));
  if (const double aspect = pixel_aspect_of(input, stream); aspect != 1.0)
    notes.push_back(wide_pixels_text(stream, aspect));
  if (HighDynamicRange::has(stream.codecpar->color_trc))
    notes.push_back(std::string("its images are of high dynamic range (") +
                    (stream.codecpar->color_trc == AVCOL_TRC_SMPTE2084 ? "PQ" : "HLG") +
                    "): they are mapped to 8 bits of sRGB, in which light above 80 % of the reference white is "
                    "compressed");
  if (is_interlaced(stream.codecpar->field_order)) notes.push_back(interlaced_text());
  if (std::string several = several_text(input, stream); !several.empty()) notes.push_back(std::move(several));
  return notes;
}

std::vector<std::size_t> find_gaps(const std::vector<double>& times_s) {
  constexpr double kShortest_s = 0.5, kPeriods = 10.0;
  if (times_s.size() < 3) return {};
  std::vector<double> periods_s;
  for (std::size_t i = 1; i < times_s.size(); ++i) periods_s.push_back(times_s[i] - times_s[i - 1]);
  const double least_s = std::max(kShortest_s, kPeriods * base::upper_median(periods_s));
  std::vector<std::size_t> found;
  for (std::size_t i = 0; i < periods_s.size(); ++i)
    if (periods_s[i] >= least_s) found.push_back(i + 1);
  return found;
}

std::string describe_gaps(const std::vector<double>& times_s) {
  const std::vector<std::size_t> gaps = find_gaps(times_s);
  if (gaps.empty()) return {};
  const auto length_s = [&](std::size_t next) { return times_s[next] - times_s[next - 1]; };
  const std::size_t longest = *std::ranges::max_element(gaps, {}, length_s);
  return (gaps.size() == 1 ? std::string("it has a gap: ")
                           : base::formatted("it has %zu gaps, the longest: ", gaps.size())) +
         base::formatted(
             "no image for %.2f s after %.2f s; what lies before and after it may not be connected "
             "(--from, --to)",
             length_s(longest), times_s[longest - 1]);
}

}  // namespace tileflight::video
