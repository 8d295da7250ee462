#include <cmath>
#include <stdexcept>
#include <string>

extern "C" {
#include <libavutil/opt.h>
}

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/data/video/libav.h"
#include "tileflight/data/video/video.h"

namespace tileflight::video {

namespace {

namespace fs = std::filesystem;

/// Frame rate as a fraction: exact for integer and half rates and those of NTSC (30000/1001).
AVRational rate_of(double frames_per_second) { return av_d2q(frames_per_second, 100000); }

const AVCodec* find_encoder() {
  if (const AVCodec* x264 = avcodec_find_encoder_by_name("libx264")) return x264;
  return avcodec_find_encoder(AV_CODEC_ID_MPEG4);
}

}  // namespace

struct VideoWriter::Impl {
  fs::path file;
  fs::path temporary;
  AVFormatContext* format = nullptr;
  AVStream* stream = nullptr;
  libav::Owner<AVCodecContext> codec;
  libav::Owner<AVFrame> frame{av_frame_alloc()};
  libav::Owner<AVPacket> packet{av_packet_alloc()};
  libav::Owner<SwsContext> scaler;
  std::int64_t frames = 0;

  ~Impl() {
    if (format != nullptr) {
      avio_closep(&format->pb);
      avformat_free_context(format);
    }
    std::error_code ignored;
    fs::remove(temporary, ignored);  // does not exist after finish(), which renames it
  }

  void require(int code, const char* what) const {
    if (code < 0) throw InputError(file.string(), std::string(what) + ": " + libav::error_text(code));
  }

  void open_encoder(int width, int height, const VideoOptions& options);
  void set_compression(AVCodecID id, const VideoCompression& rate);
  void open_file();
  void make_scaler();
  void encode(const AVFrame* image);
};

void VideoWriter::Impl::open_encoder(int width, int height, const VideoOptions& options) {
  const AVCodec* encoder = find_encoder();
  if (encoder == nullptr) throw InputError(file.string(), "libavcodec has no H.264 and no MPEG-4 encoder");
  codec.reset(avcodec_alloc_context3(encoder));
  codec->width = width;
  codec->height = height;
  codec->pix_fmt = AV_PIX_FMT_YUV420P;
  codec->framerate = rate_of(options.frames_per_second);
  codec->time_base = av_inv_q(codec->framerate);
  codec->gop_size = static_cast<int>(std::lround(2.0 * options.frames_per_second)) + 1;
  codec->max_b_frames = 2;
  codec->thread_count = 1;  // x264's output depends on the number of threads
  codec->color_range = AVCOL_RANGE_MPEG;
  codec->colorspace = AVCOL_SPC_BT709;
  codec->color_primaries = AVCOL_PRI_BT709;
  codec->color_trc = AVCOL_TRC_BT709;
  codec->flags |= AV_CODEC_FLAG_GLOBAL_HEADER | AV_CODEC_FLAG_BITEXACT;
  set_compression(encoder->id, options.compression);
  require(avcodec_open2(codec.get(), encoder, nullptr), "the video encoder cannot be opened");
}

void VideoWriter::Impl::set_compression(AVCodecID id, const VideoCompression& rate) {
  if (id == AV_CODEC_ID_H264) {
    av_opt_set(codec->priv_data, "preset", "veryfast", 0);
    // Otherwise x264 uses different code on different processors, and its AVX-512 code (of macroblock-tree rate
    // control) depends on uninitialized memory.
    const char* const features = libav::forced_features();
    av_opt_set(codec->priv_data, "x264-params",
               ("cpu-independent=1" + (features == nullptr ? "" : std::string(":asm=") + features)).c_str(), 0);
  }
  if (rate.megabits_per_s > 0.0) {
    codec->bit_rate = std::llround(1e6 * rate.megabits_per_s);
  } else if (id == AV_CODEC_ID_H264) {
    av_opt_set_double(codec->priv_data, "crf", rate.crf, 0);
  } else {
    codec->flags |= AV_CODEC_FLAG_QSCALE;
    codec->global_quality = FF_QP2LAMBDA * std::max(1, rate.crf / 6);
  }
}

void VideoWriter::Impl::open_file() {
  require(avformat_alloc_output_context2(&format, nullptr, "mp4", nullptr), "libavformat cannot write MP4");
  format->flags |= AVFMT_FLAG_BITEXACT;  // no version or date in the file
  stream = avformat_new_stream(format, nullptr);
  if (stream == nullptr) throw std::bad_alloc();
  stream->time_base = codec->time_base;
  stream->avg_frame_rate = codec->framerate;
  avcodec_parameters_from_context(stream->codecpar, codec.get());
  require(avio_open(&format->pb, libav::file_url(temporary).c_str(), AVIO_FLAG_WRITE), "cannot be written");
  require(avformat_write_header(format, nullptr), "cannot be written");
}

void VideoWriter::Impl::make_scaler() {
  frame->format = AV_PIX_FMT_YUV420P;
  frame->width = codec->width;
  frame->height = codec->height;
  require(av_frame_get_buffer(frame.get(), 0), "out of memory for a frame");
  constexpr int kFlags = SWS_BILINEAR | SWS_ACCURATE_RND | SWS_FULL_CHR_H_INP | SWS_BITEXACT;
  scaler.reset(sws_getContext(codec->width, codec->height, AV_PIX_FMT_RGB24, codec->width, codec->height,
                              AV_PIX_FMT_YUV420P, kFlags, nullptr, nullptr, nullptr));
  if (scaler == nullptr) throw std::bad_alloc();
  sws_setColorspaceDetails(scaler.get(), sws_getCoefficients(SWS_CS_DEFAULT), 1, sws_getCoefficients(SWS_CS_ITU709), 0,
                           0, 1 << 16, 1 << 16);
}

/// Encodes a frame, or flushes the encoder (nullptr), into the file.
void VideoWriter::Impl::encode(const AVFrame* image) {
  require(avcodec_send_frame(codec.get(), image), "a frame cannot be encoded");
  for (;;) {
    const int received = avcodec_receive_packet(codec.get(), packet.get());
    if (received == AVERROR(EAGAIN) || received == AVERROR_EOF) return;
    require(received, "a frame cannot be encoded");
    packet->duration = 1;
    packet->stream_index = stream->index;
    av_packet_rescale_ts(packet.get(), codec->time_base, stream->time_base);
    require(av_interleaved_write_frame(format, packet.get()), "cannot be written");
    require(format->pb->error, "cannot be written");
  }
}

VideoWriter::VideoWriter(const fs::path& file, int width, int height, const VideoOptions& options)
    : impl_(std::make_unique<Impl>()) {
  libav::set_process_wide();
  impl_->file = file;
  if (width <= 0 || height <= 0 || width % 2 != 0 || height % 2 != 0)
    throw InputError(file.string(), "a video's width and height must be even, not " + std::to_string(width) + "x" +
                                        std::to_string(height));
  if (!(options.frames_per_second > 0.0 && options.frames_per_second <= 1000.0))
    throw InputError(file.string(), "the frame rate must be above 0 and at most 1000 frames a second");
  if (options.compression.crf < 0 || options.compression.crf > 51)
    throw InputError(file.string(), "crf must be from 0 to 51");
  if (!(options.compression.megabits_per_s >= 0.0 && options.compression.megabits_per_s <= 1000.0))
    throw InputError(file.string(), "the bit rate must be from 0 to 1000 Mbit/s");
  impl_->temporary = base::make_temporary_path(file);
  impl_->open_encoder(width, height, options);
  impl_->open_file();
  impl_->make_scaler();
}

VideoWriter::~VideoWriter() = default;

void VideoWriter::add(const imaging::RgbImage& image) {
  if (image.width != impl_->codec->width || image.height != impl_->codec->height)
    throw InputError(impl_->file.string(), "a frame of " + std::to_string(image.width) + "x" +
                                               std::to_string(image.height) + " does not match the video's size");
  AVFrame* frame = impl_->frame.get();
  impl_->require(av_frame_make_writable(frame), "out of memory for a frame");
  const std::uint8_t* const planes[] = {image.pixels.data()->data()};
  const int strides[] = {3 * image.width};
  sws_scale(impl_->scaler.get(), planes, strides, 0, image.height, frame->data, frame->linesize);
  frame->pts = impl_->frames++;
  impl_->encode(frame);
}

void VideoWriter::finish() {
  if (impl_->frames == 0) throw InputError(impl_->file.string(), "no frames were written");
  impl_->encode(nullptr);
  impl_->require(av_write_trailer(impl_->format), "cannot be written");
  impl_->require(avio_closep(&impl_->format->pb), "cannot be written");
  std::error_code error;
  fs::rename(impl_->temporary, impl_->file, error);
  if (error) throw InputError(impl_->file.string(), "cannot be written: " + error.message());
}

}  // namespace tileflight::video
