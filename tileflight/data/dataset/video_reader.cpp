#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/dataset/video.h"
#include "tileflight/data/dataset/video_decoder.h"

namespace tileflight::dataset {

namespace {

using imaging::RgbImage;

void check_excerpt(const VideoExcerpt& excerpt, const std::string& file) {
  if (!(excerpt.from_s >= 0.0)) throw InputError(file, "the excerpt must start at 0 s or later");
  if (excerpt.to_s && !(*excerpt.to_s > excerpt.from_s)) throw InputError(file, "the excerpt must end after its start");
  if (excerpt.every < 1) throw InputError(file, "the step of the excerpt must be 1 or more frames");
}

RgbImage rotate_quarter_clockwise(const RgbImage& image) {
  RgbImage out(image.height, image.width);
  for (int y = 0; y < image.height; ++y)
    for (int x = 0; x < image.width; ++x) out(image.height - 1 - y, x) = image(x, y);
  return out;
}

RgbImage rotate_clockwise(RgbImage image, int quarter_turns) {
  for (int i = 0; i < quarter_turns; ++i) image = rotate_quarter_clockwise(image);
  return image;
}

/// Converts YUV of any layout to RGB, by the frame's matrix and range (default: BT.601, limited).
class RgbConverter {
 public:
  RgbImage convert(const AVFrame& frame, const std::string& file) {
    const auto format = static_cast<AVPixelFormat>(frame.format);
    if (scaler_ == nullptr || format != format_ || frame.width != width_ || frame.height != height_)
      set_up(frame, file);
    RgbImage image(frame.width, frame.height);
    std::uint8_t* const planes[] = {image.pixels.data()->data()};
    const int strides[] = {3 * frame.width};
    sws_scale(scaler_.get(), frame.data, frame.linesize, 0, frame.height, planes, strides);
    return image;
  }

 private:
  void set_up(const AVFrame& frame, const std::string& file) {
    if (scaler_ != nullptr && (frame.width != width_ || frame.height != height_))
      throw InputError(file, "the size of the frames changes within the video");
    format_ = static_cast<AVPixelFormat>(frame.format);
    width_ = frame.width;
    height_ = frame.height;
    constexpr int kFlags = SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_BITEXACT;
    scaler_.reset(
        sws_getContext(width_, height_, format_, width_, height_, AV_PIX_FMT_RGB24, kFlags, nullptr, nullptr, nullptr));
    if (scaler_ == nullptr) throw InputError(file, "its pixel format cannot be converted to RGB");
    const int full_range = frame.color_range == AVCOL_RANGE_JPEG ? 1 : 0;
    sws_setColorspaceDetails(scaler_.get(), sws_getCoefficients(frame.colorspace), full_range,
                             sws_getCoefficients(SWS_CS_DEFAULT), 1, 0, 1 << 16, 1 << 16);
  }

  libav::Owner<SwsContext> scaler_;
  AVPixelFormat format_ = AV_PIX_FMT_NONE;
  int width_ = 0, height_ = 0;
};

/// The first frame of the excerpt; nullptr if the video ends before it.
const AVFrame* first_frame(VideoDecoder& decoder, double from_s) {
  constexpr double kWorthSearching_s = 3.0;
  const AVFrame* frame = decoder.next();
  if (frame != nullptr && from_s > kWorthSearching_s) {
    decoder.seek_before(from_s);
    frame = decoder.next();
  }
  constexpr double kRounding_s = 1e-9;
  while (frame != nullptr && decoder.time_s() < from_s - kRounding_s) frame = decoder.next();
  return frame;
}

}  // namespace

VideoInfo probe_video(const std::filesystem::path& file) { return VideoDecoder(file).info(); }

void read_video(const std::filesystem::path& file, const VideoExcerpt& excerpt,
                const std::function<bool(std::int64_t, double, const RgbImage&)>& on_frame) {
  check_excerpt(excerpt, file.string());
  VideoDecoder decoder(file);
  RgbConverter converter;
  std::int64_t in_excerpt = 0;
  const AVFrame* frame = first_frame(decoder, excerpt.from_s);
  for (; frame != nullptr; frame = decoder.next(), ++in_excerpt) {
    if (excerpt.to_s && decoder.time_s() >= *excerpt.to_s) break;
    if (decoder.is_damaged())
      throw InputError(file.string(), "is damaged at " + base::rounded_text(decoder.time_s(), 2) + " s");
    if (in_excerpt % excerpt.every != 0) continue;
    const RgbImage image = rotate_clockwise(converter.convert(*frame, file.string()), decoder.quarter_turns());
    if (!on_frame(in_excerpt / excerpt.every, decoder.time_s(), image)) return;
  }
  if (in_excerpt > 0) return;
  throw InputError(file.string(), "contains no frame from " + base::rounded_text(excerpt.from_s, 2) + " s" +
                                      (excerpt.to_s ? " to " + base::rounded_text(*excerpt.to_s, 2) + " s" : "") +
                                      "; it is " + base::rounded_text(decoder.info().duration_s, 2) + " s long");
}

}  // namespace tileflight::dataset
