
#include <algorithm>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

extern "C" {
#include <libavutil/display.h>
#include <libavutil/pixdesc.h>
}

#include "tileflight/core/base/formatted_text.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/video/high_dynamic_range.h"
#include "tileflight/data/video/libav.h"
#include "tileflight/data/video/unusual_images.h"
#include "tileflight/data/video/video.h"

namespace tileflight::video {

namespace {

/// The video stream of a file, frame by frame in display order. All throw InputError (file, cause).
class VideoDecoder {
 public:
  explicit VideoDecoder(const std::filesystem::path& file);
  ~VideoDecoder();
  VideoDecoder(const VideoDecoder&) = delete;
  VideoDecoder& operator=(const VideoDecoder&) = delete;

  /// Size after rotation, frame rate and duration, without decoding.
  VideoInfo info() const;

  /// The next frame; nullptr after the last. Valid until the next call. For a truncated or damaged file, returns the
  /// frames before the fault, then throws.
  const AVFrame* next();
  /// Time of the frame returned by next(), seconds after the file's first frame.
  double time_s() const { return time_s_; }
  /// Whether parts of that frame could not be decoded. This also happens in sound files just after seek_before().
  bool is_damaged() const;

  /// Skips what is damaged before `time_s`, of which the caller wants no frame.
  void tolerate_damage_until(double time_s) { tolerates_until_s_ = time_s; }
  /// Whether no key frame came since the last damage that was skipped: the frames are predicted from damaged ones.
  bool depends_on_damage() const { return depends_on_damage_; }

  /// Seeks to a frame at or before `time_s` if the file's index allows it, else to the first frame. Requires a previous
  /// next().
  void seek_before(double time_s);

  /// Clockwise quarter turns for display (the container's display matrix), 0 to 3.
  int quarter_turns() const { return quarter_turns_; }
  /// Throws InputError unless the frame returned by next() has the size that info() states.
  void require_stated_size() const;
  /// Tells whether the frame returned by next() says that it is interlaced although the container does not.
  bool is_unstated_interlaced() const;

 private:
  void open();
  void open_decoder();
  void read_rotation();
  bool has_full_index() const;
  void send_next_packet();
  void note_end(int code);
  bool is_incomplete() const;
  void note_time(const AVPacket& packet);
  std::string position_text() const;
  void require_later(double time_s) const;
  void restart_at(std::int64_t timestamp);
  double time_of(const AVFrame& frame);
  /// The stated rate of images; 0/1 or 0/0: unknown.
  AVRational frame_rate() const;
  bool is_before_excerpt() const { return std::max(time_s_, 0.0) < tolerates_until_s_; }

  std::filesystem::path file_;
  AVFormatContext* format_ = nullptr;
  AVStream* stream_ = nullptr;
  libav::Owner<AVCodecContext> codec_;
  libav::Owner<AVFrame> frame_;
  libav::Owner<AVPacket> packet_;
  int quarter_turns_ = 0;
  int stored_width_ = 0, stored_height_ = 0;  ///< of the images, as the container states them
  std::optional<std::int64_t> first_timestamp_;
  double time_s_ = -1.0;
  bool has_seeked_ = false;                       ///< seek_before() has changed the position
  std::int64_t frames_ = 0;                       ///< returned since the file's start or the last seek
  std::int64_t packets_ = 0;                      ///< read since the last seek
  std::int64_t last_timestamp_ = AV_NOPTS_VALUE;  ///< decoding time of the last complete packet
  double end_s_ = 0.0;                            ///< end of the latest packet of any stream
  bool drained_ = false;
  double tolerates_until_s_ = 0.0;  ///< damage before this time is skipped: the caller wants no frame of it
  bool depends_on_damage_ = false;  ///< no key frame has come since the last damage
  std::string fault_;  ///< why reading stopped early; thrown after the frames before the fault were returned
};

using libav::error_text;

constexpr const char* kRepair =
    "use the part before or after it (--from and --to, in an experiment from and to of its ingest), or repair the "
    "file: ffmpeg -err_detect ignore_err -i IN -c:v libx264 -crf 16 OUT";

/// Formats that libavformat opens as "video" although they are not.
bool is_not_video(const AVFormatContext& format) {
  const std::string_view name = format.iformat->name;
  return name == "image2" || name == "tty" || name.ends_with("_pipe");
}

VideoDecoder::VideoDecoder(const std::filesystem::path& file)
    : file_(file), frame_(av_frame_alloc()), packet_(av_packet_alloc()) {
  libav::set_process_wide();
  try {
    open();
  } catch (...) {
    avformat_close_input(&format_);
    throw;
  }
}

VideoDecoder::~VideoDecoder() { avformat_close_input(&format_); }

void VideoDecoder::open() {
  if (!std::filesystem::is_regular_file(file_)) throw InputError(file_.string(), "no such video file");
  AVDictionary* options = nullptr;
  av_dict_set(&options, "protocol_whitelist", "file", 0);  // a playlist must not reach the network
  const int opened = avformat_open_input(&format_, libav::file_url(file_).c_str(), nullptr, &options);
  av_dict_free(&options);
  if (opened < 0)
    throw InputError(file_.string(), "is not a readable video (truncated, or not a video): " + error_text(opened));
  const int probed = avformat_find_stream_info(format_, nullptr);
  if (probed < 0) throw InputError(file_.string(), "is not a readable video: " + error_text(probed));
  open_decoder();
  read_rotation();
}

void VideoDecoder::open_decoder() {
  const int stream = libav::find_video_stream(*format_);
  if (stream < 0 || is_not_video(*format_)) throw InputError(file_.string(), "contains no video");
  stream_ = format_->streams[stream];
  const AVCodec* const decoder = avcodec_find_decoder(stream_->codecpar->codec_id);
  if (decoder == nullptr) throw InputError(file_.string(), "its video codec is not supported: re-encode it as H.264");
  stored_width_ = stream_->codecpar->width;
  stored_height_ = stream_->codecpar->height;
  for (unsigned i = 0; i < format_->nb_streams && has_full_index(); ++i)
    if (static_cast<int>(i) != stream) format_->streams[i]->discard = AVDISCARD_ALL;
  codec_.reset(avcodec_alloc_context3(decoder));
  avcodec_parameters_to_context(codec_.get(), stream_->codecpar);
  // Several threads would conceal the damage of a video differently from run to run.
  codec_->thread_count = 1;
  codec_->pkt_timebase = stream_->time_base;
  const int opened = avcodec_open2(codec_.get(), decoder, nullptr);
  if (opened < 0) throw InputError(file_.string(), "its video cannot be decoded: " + error_text(opened));
}

void VideoDecoder::read_rotation() {
  const std::int32_t* const matrix = libav::display_matrix(*stream_);
  if (matrix == nullptr) return;
  const double counter_clockwise_deg = av_display_rotation_get(matrix);
  const double turns = -counter_clockwise_deg / 90.0;
  if (!std::isfinite(turns) || std::abs(turns - std::round(turns)) > 1e-3)
    throw InputError(file_.string(), "its rotation flag is not a multiple of 90 degrees");
  const double determinant = static_cast<double>(matrix[0]) * matrix[4] - static_cast<double>(matrix[1]) * matrix[3];
  if (determinant < 0.0)
    throw InputError(
        file_.string(),
        "its rotation flag mirrors the images, and a mirrored place is another one: remove the flag if the "
        "stored images are as the camera saw them (ffmpeg -noautorotate -i IN -c:v libx264 -crf 16 OUT), "
        "else mirror them (ffmpeg -i IN -c:v libx264 -crf 16 OUT)");
  quarter_turns_ = (static_cast<int>(std::lround(turns)) + 4) % 4;
}

AVRational VideoDecoder::frame_rate() const {
  // For a stream without times, FFmpeg 7 states the rate of fields and guesses the average. The codec knows the rate.
  const bool has_times = (format_->iformat->flags & AVFMT_NOTIMESTAMPS) == 0;
  if (!has_times && codec_->framerate.num > 0) return codec_->framerate;
  return has_times && stream_->avg_frame_rate.num > 0 ? stream_->avg_frame_rate : stream_->r_frame_rate;
}

VideoInfo VideoDecoder::info() const {
  VideoInfo info;
  info.width = stored_width_;
  info.height = stored_height_;
  info.pixel_aspect = pixel_aspect_of(*format_, *stream_);
  if (quarter_turns_ % 2 == 1) {
    std::swap(info.width, info.height);
    info.pixel_aspect = 1.0 / info.pixel_aspect;
  }
  info.quarter_turns = quarter_turns_;
  for (const std::string& note : describe_unusual_images(*format_, *stream_, quarter_turns_))
    info.notes.push_back(file_.string() + ": " + note);
  const AVRational rate = frame_rate();
  if (rate.num > 0 && rate.den > 0) info.frames_per_second = av_q2d(rate);
  if (stream_->duration != AV_NOPTS_VALUE)
    info.duration_s = static_cast<double>(stream_->duration) * av_q2d(stream_->time_base);
  else if (format_->duration != AV_NOPTS_VALUE)
    info.duration_s = static_cast<double>(format_->duration) / AV_TIME_BASE;
  info.declared_frames = stream_->nb_frames;
  const AVDictionaryEntry* made = av_dict_get(format_->metadata, "creation_time", nullptr, 0);
  if (made != nullptr) info.creation_time = made->value;
  return info;
}

/// MP4 and MOV list every packet at the start; other containers' indices grow while reading or hold key frames only.
bool VideoDecoder::has_full_index() const {
  const std::string_view name = format_->iformat->name;
  return name.find("mp4") != std::string_view::npos && stream_->nb_frames > 0 &&
         avformat_index_get_entries_count(stream_) > 0;
}

/// Whether packets announced by the container are missing: by its index, else by its frame count or duration.
bool VideoDecoder::is_incomplete() const {
  if (has_full_index()) {
    const AVIndexEntry* last = avformat_index_get_entry(stream_, avformat_index_get_entries_count(stream_) - 1);
    return last_timestamp_ < last->timestamp;
  }
  if (packets_ < stream_->nb_frames) return true;
  constexpr double kTolerance_s = 0.25;  // durations in headers are rounded, and the last frame's is often unknown
  const bool guessed =
      format_->duration == AV_NOPTS_VALUE || format_->duration_estimation_method == AVFMT_DURATION_FROM_BITRATE;
  return !guessed && end_s_ < static_cast<double>(format_->duration) / AV_TIME_BASE - kTolerance_s;
}

/// Updates the end of the latest packet of any stream, seconds after the file's start.
void VideoDecoder::note_time(const AVPacket& packet) {
  if (packet.pts == AV_NOPTS_VALUE) return;
  const double start_s =
      format_->start_time == AV_NOPTS_VALUE ? 0.0 : static_cast<double>(format_->start_time) / AV_TIME_BASE;
  const double end_s = static_cast<double>(packet.pts + packet.duration) * av_q2d(packet.time_base);
  end_s_ = std::max(end_s_, end_s - start_s);
}

void VideoDecoder::note_end(int code) {
  if (is_incomplete())
    fault_ = "ends early";
  else if (code != AVERROR_EOF)
    fault_ = "cannot be read further (" + error_text(code) + ")";
  avcodec_send_packet(codec_.get(), nullptr);
}

/// Sends the next packet to the decoder, or signals the end.
void VideoDecoder::send_next_packet() {
  for (;;) {
    av_packet_unref(packet_.get());
    const int read = av_read_frame(format_, packet_.get());
    if (read < 0) return note_end(read);
    packet_->time_base = format_->streams[packet_->stream_index]->time_base;
    note_time(*packet_);
    if (packet_->stream_index != stream_->index) continue;
    if ((packet_->flags & AV_PKT_FLAG_CORRUPT) != 0) {
      const bool goes_on = avio_feof(format_->pb) == 0;
      if (goes_on && is_before_excerpt()) {
        depends_on_damage_ = true;
      } else {  // the file is truncated within the packet, or, of a transport stream, packets are missing
        note_end(AVERROR_EOF);
        fault_ = goes_on ? "is damaged, or joined from files that do not go on from each other," : "ends early";
        return;
      }
    }
    ++packets_;
    if (packet_->dts != AV_NOPTS_VALUE) last_timestamp_ = packet_->dts;
    const int sent = avcodec_send_packet(codec_.get(), packet_.get());
    if (sent < 0 && sent != AVERROR(EAGAIN) && is_before_excerpt()) {
      depends_on_damage_ = true;
      continue;
    }
    if (sent < 0 && sent != AVERROR(EAGAIN)) {
      fault_ = "is damaged (" + error_text(sent) + ")";
      avcodec_send_packet(codec_.get(), nullptr);
    }
    return;
  }
}

double VideoDecoder::time_of(const AVFrame& frame) {
  if (frame.best_effort_timestamp == AV_NOPTS_VALUE) {  // a raw stream without times
    const AVRational rate = frame_rate();
    return static_cast<double>(frames_) / (rate.num > 0 && rate.den > 0 ? av_q2d(rate) : 30.0);
  }
  if (!first_timestamp_) first_timestamp_ = frame.best_effort_timestamp;
  return static_cast<double>(frame.best_effort_timestamp - *first_timestamp_) * av_q2d(stream_->time_base);
}

const AVFrame* VideoDecoder::next() {
  while (!drained_) {
    const int received = avcodec_receive_frame(codec_.get(), frame_.get());
    if (received == AVERROR(EAGAIN)) {
      send_next_packet();
      continue;
    }
    if (received == AVERROR_EOF) {
      drained_ = true;
      break;
    }
    if (received < 0 && is_before_excerpt()) {
      depends_on_damage_ = true;
      continue;
    }
    if (received < 0)
      throw InputError(file_.string(), "is damaged " + position_text() + ": " + error_text(received) + "; " + kRepair);
    const double time = time_of(*frame_);
    if (frames_ > 0) require_later(time);
    time_s_ = time;
    ++frames_;
    if (libav::is_key_frame(*frame_)) depends_on_damage_ = false;
    if (is_damaged() && is_before_excerpt()) depends_on_damage_ = true;
    return frame_.get();
  }
  if (fault_.empty()) return nullptr;
  throw InputError(file_.string(), fault_ + " " + position_text() +
                                       (fault_.starts_with("is damaged") ? std::string("; ") + kRepair : ""));
}

void VideoDecoder::require_later(double time_s) const {
  if (time_s > time_s_) return;
  const std::string remedy =
      ": give the frames new times (ffmpeg -i IN -c copy OUT.mp4), or read the part before (--to)";
  if (time_s == time_s_) throw InputError(file_.string(), "two frames have the same time " + position_text() + remedy);
  throw InputError(file_.string(), "the times of its frames go back by " + base::rounded_text(time_s_ - time_s, 2) +
                                       " s " + position_text() + remedy);
}

void VideoDecoder::require_stated_size() const {
  if (frame_->width == stored_width_ && frame_->height == stored_height_) return;
  const auto size = [](int width, int height) { return std::to_string(width) + "x" + std::to_string(height); };
  const std::string time = base::rounded_text(std::max(time_s_, 0.0), 2);
  throw InputError(file_.string(),
                   "the size of its images changes: " + size(frame_->width, frame_->height) + " at " + time + " s, " +
                       size(stored_width_, stored_height_) +
                       " stated for all; a calibration is for one size: read the part before the change (--to), or cut "
                       "the file there (ffmpeg -ss " +
                       time + " -i IN -c copy OUT)");
}

bool VideoDecoder::is_unstated_interlaced() const {
  return libav::is_interlaced(*frame_) && stream_->codecpar->field_order <= AV_FIELD_PROGRESSIVE;
}

std::string VideoDecoder::position_text() const {
  const std::string time = "after " + base::rounded_text(std::max(time_s_, 0.0), 2) + " s";
  if (has_seeked_ || stream_->nb_frames == 0) return time;
  return time + ", frame " + std::to_string(frames_) + " of " + std::to_string(stream_->nb_frames);
}

bool VideoDecoder::is_damaged() const {
  constexpr int kFlags = FF_DECODE_ERROR_INVALID_BITSTREAM | FF_DECODE_ERROR_DECODE_SLICES;
  return (frame_->flags & AV_FRAME_FLAG_CORRUPT) != 0 || (frame_->decode_error_flags & kFlags) != 0;
}

void VideoDecoder::restart_at(std::int64_t timestamp) {
  const int found = av_seek_frame(format_, stream_->index, timestamp, AVSEEK_FLAG_BACKWARD);
  if (found < 0) throw InputError(file_.string(), "cannot be searched: " + error_text(found));
  avcodec_flush_buffers(codec_.get());
  packets_ = frames_ = 0;
  last_timestamp_ = AV_NOPTS_VALUE;
  time_s_ = -1.0;
  drained_ = false;
  fault_.clear();
}

void VideoDecoder::seek_before(double time_s) {
  if (!has_full_index() || !first_timestamp_) return;
  constexpr double kMargin_s = 1.0;  // the index uses decoding times; frames are displayed later
  const auto wanted = static_cast<std::int64_t>((time_s - kMargin_s) / av_q2d(stream_->time_base));
  if (wanted <= 0) return;
  has_seeked_ = true;
  restart_at(*first_timestamp_ + wanted);
}

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

/// Converts YUV of any layout to RGB, by the frame's matrix and range (default: BT.601, and the range that its layout
/// usually has: full for grey and for JPEG's YUV).
class RgbConverter {
 public:
  RgbImage convert(const AVFrame& frame, const std::string& file) {
    const Format format = format_of(frame);
    if (scaler_ == nullptr || !(format == format_)) set_up(format, frame, file);
    RgbImage image(frame.width, frame.height);
    if (hdr_) {
      std::vector<std::uint16_t> deep(3 * image.pixels.size());
      scale(frame, reinterpret_cast<std::uint8_t*>(deep.data()), 6 * frame.width);
      hdr_->map(deep, image.pixels);
    } else {
      scale(frame, image.pixels.data()->data(), 3 * frame.width);
      if (is_limited_grey(frame)) stretch(image);
    }
    return image;
  }

 private:
  /// Holds the properties that decide how a frame is converted.
  struct Format {
    int width = 0, height = 0;
    int layout = AV_PIX_FMT_NONE, matrix = 0, range = 0, transfer = 0, primaries = 0;
    bool operator==(const Format&) const = default;
  };

  static Format format_of(const AVFrame& frame) {
    return {frame.width,       frame.height,    frame.format,         frame.colorspace,
            frame.color_range, frame.color_trc, frame.color_primaries};
  }

  static bool is_grey(const AVFrame& frame) {
    const AVPixFmtDescriptor* const layout = av_pix_fmt_desc_get(static_cast<AVPixelFormat>(frame.format));
    return layout != nullptr && layout->nb_components <= 2 && (layout->flags & AV_PIX_FMT_FLAG_RGB) == 0;
  }
  static bool is_limited_grey(const AVFrame& frame) { return frame.color_range == AVCOL_RANGE_MPEG && is_grey(frame); }

  /// Maps limited range to full range, which libswscale does not do for grey.
  static void stretch(RgbImage& image) {
    for (imaging::Rgb8& pixel : image.pixels)
      for (std::uint8_t& value : pixel)
        value = static_cast<std::uint8_t>(std::clamp(((value - 16) * 255 + 109) / 219, 0, 255));
  }

  void scale(const AVFrame& frame, std::uint8_t* pixels, int stride) {
    std::uint8_t* const planes[] = {pixels};
    const int strides[] = {stride};
    sws_scale(scaler_.get(), frame.data, frame.linesize, 0, frame.height, planes, strides);
  }

  void set_up(const Format& format, const AVFrame& frame, const std::string& file) {
    format_ = format;
    hdr_.reset();
    if (HighDynamicRange::has(frame.color_trc)) hdr_.emplace(frame.color_trc, frame.color_primaries);
    constexpr int kFlags = SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INT | SWS_BITEXACT;
    scaler_.reset(sws_getContext(frame.width, frame.height, static_cast<AVPixelFormat>(frame.format), frame.width,
                                 frame.height, hdr_ ? AV_PIX_FMT_RGB48 : AV_PIX_FMT_RGB24, kFlags, nullptr, nullptr,
                                 nullptr));
    if (scaler_ == nullptr) throw InputError(file, "its pixel format cannot be converted to RGB");
    int *inverse = nullptr, *forward = nullptr;  // not used
    int full_range = 0, shown_range = 0, brightness = 0, contrast = 0, saturation = 0;
    sws_getColorspaceDetails(scaler_.get(), &inverse, &full_range, &forward, &shown_range, &brightness, &contrast,
                             &saturation);
    if (is_grey(frame)) {
      full_range = 1;
    } else if (frame.color_range != AVCOL_RANGE_UNSPECIFIED) {
      full_range = frame.color_range == AVCOL_RANGE_JPEG ? 1 : 0;
    }
    sws_setColorspaceDetails(scaler_.get(), sws_getCoefficients(frame.colorspace), full_range,
                             sws_getCoefficients(SWS_CS_DEFAULT), 1, 0, 1 << 16, 1 << 16);
  }

  libav::Owner<SwsContext> scaler_;
  Format format_;
  std::optional<HighDynamicRange> hdr_;
};

/// The first frame of the excerpt; nullptr if the video ends before it.
const AVFrame* first_frame(VideoDecoder& decoder, double from_s) {
  decoder.tolerate_damage_until(from_s);
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

/// Says from when to when the video is damaged, from the present frame on, and where undamaged frames follow.
std::string describe_damage(VideoDecoder& decoder) {
  constexpr double kFarthest_s = 10.0;
  const double from_s = decoder.time_s();
  double to_s = from_s, after_s = from_s;
  decoder.tolerate_damage_until(std::numeric_limits<double>::infinity());
  while (decoder.next() != nullptr && decoder.time_s() < from_s + kFarthest_s) {
    if (decoder.is_damaged())
      to_s = decoder.time_s();
    else if (after_s <= to_s)
      after_s = decoder.time_s();
  }
  std::string text = "is damaged at " + base::rounded_text(from_s, 2) + " s";
  if (to_s > from_s) text += ", and again until " + base::rounded_text(to_s, 2) + " s";
  if (after_s > to_s) text += "; undamaged images follow from " + base::rounded_text(after_s + 0.005, 2) + " s on";
  return text + "; " + kRepair;
}

}  // namespace

VideoInfo probe_video(const std::filesystem::path& file) { return VideoDecoder(file).info(); }

std::vector<std::string> read_video(const std::filesystem::path& file, const VideoExcerpt& excerpt,
                                    const std::function<bool(std::int64_t, double, const RgbImage&)>& on_frame) {
  check_excerpt(excerpt, file.string());
  VideoDecoder decoder(file);
  RgbConverter converter;
  std::int64_t in_excerpt = 0;
  std::vector<std::string> notes;
  std::vector<double> times_s;
  const auto finished = [&] {
    if (const std::string gaps = describe_gaps(times_s); !gaps.empty()) notes.push_back(file.string() + ": " + gaps);
    return notes;
  };
  const AVFrame* frame = first_frame(decoder, excerpt.from_s);
  if (frame != nullptr && decoder.depends_on_damage())
    notes.push_back(file.string() +
                    ": is damaged before the excerpt, and no key frame comes between: the images from " +
                    base::rounded_text(decoder.time_s(), 2) +
                    " s on may be smeared; begin later if they are (--from, in an experiment from)");
  if (frame != nullptr && decoder.is_unstated_interlaced()) notes.push_back(file.string() + ": " + interlaced_text());
  for (; frame != nullptr; frame = decoder.next(), ++in_excerpt) {
    if (excerpt.to_s && decoder.time_s() >= *excerpt.to_s) break;
    if (decoder.is_damaged()) throw InputError(file.string(), describe_damage(decoder));
    decoder.require_stated_size();
    times_s.push_back(decoder.time_s());
    if (in_excerpt % excerpt.every != 0) continue;
    const RgbImage image = rotate_clockwise(converter.convert(*frame, file.string()), decoder.quarter_turns());
    if (!on_frame(in_excerpt / excerpt.every, decoder.time_s(), image)) return finished();
  }
  if (in_excerpt > 0) return finished();
  if (decoder.depends_on_damage())
    throw InputError(file.string(),
                     "is damaged before the excerpt, and no key frame follows from which the rest could be "
                     "decoded; use the part before the damage (--to, in an experiment to), or record again");
  throw InputError(file.string(), "contains no frame from " + base::rounded_text(excerpt.from_s, 2) + " s" +
                                      (excerpt.to_s ? " to " + base::rounded_text(*excerpt.to_s, 2) + " s" : "") +
                                      "; it is " + base::rounded_text(decoder.info().duration_s, 2) + " s long");
}

}  // namespace tileflight::video
