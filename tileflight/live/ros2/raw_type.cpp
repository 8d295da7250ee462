#include "tileflight/live/ros2/raw_type.h"

#include <dds/dds.h>
#include <dds/ddsi/ddsi_serdata.h>
#include <dds/ddsi/ddsi_sertype.h>
#include <dds/ddsi/q_radmin.h>

#include <array>
#include <cstring>
#include <memory>
#include <new>

// The functions that CycloneDDS 0.10 requires of a type (dds/ddsi/ddsi_sertype.h, ddsi_serdata.h).

namespace tileflight::ros2 {

void take_all(std::int32_t reader, const std::function<void(const RawMessage& message, std::uint64_t sender)>& handle) {
  constexpr std::uint32_t kAtOnce = 16;
  std::array<ddsi_serdata*, kAtOnce> taken{};
  std::array<dds_sample_info_t, kAtOnce> infos{};
  for (;;) {
    const dds_return_t count = dds_takecdr(reader, taken.data(), kAtOnce, infos.data(), DDS_ANY_STATE);
    for (std::size_t i = 0; static_cast<dds_return_t>(i) < count; ++i) {
      if (infos[i].valid_data) handle(raw_message(*taken[i]), infos[i].publication_handle);
      ddsi_serdata_unref(taken[i]);
      taken[i] = nullptr;
    }
    if (count < static_cast<dds_return_t>(kAtOnce)) return;
  }
}

namespace {

struct RawType : ddsi_sertype {
  std::size_t max_bytes = 0;
};

struct RawData : ddsi_serdata {
  std::string bytes;     ///< padded to a multiple of four, as the wire wants it
  std::size_t size = 0;  ///< of the message; bytes is empty if it is too large
};

const RawType& as_raw(const ddsi_sertype* type) { return *static_cast<const RawType*>(type); }
const RawData& as_raw(const ddsi_serdata* data) { return *static_cast<const RawData*>(data); }

std::size_t padded(std::size_t size) { return (size + 3) / 4 * 4; }

/// Padding is sent along: its count is not told to readers, who know from the type where a message ends.
std::unique_ptr<RawData> new_data(const ddsi_sertype* type, ddsi_serdata_kind kind, std::string bytes) {
  auto data = std::make_unique<RawData>();
  ddsi_serdata_init(data.get(), type, kind);
  data->bytes = std::move(bytes);
  data->size = padded(data->bytes.size());
  data->bytes.resize(data->size);
  return data;
}

/// Room for a message of that size; nullptr: it is too large, or there is no memory.
std::unique_ptr<RawData> receive(const ddsi_sertype* type, ddsi_serdata_kind kind, std::size_t size) try {
  const bool fits = size <= as_raw(type).max_bytes;
  auto data = new_data(type, kind, std::string(fits ? size : 0, '\0'));
  data->size = padded(size);
  return data;
} catch (const std::bad_alloc&) {
  return nullptr;
}

uint32_t get_size(const ddsi_serdata* data) { return static_cast<uint32_t>(as_raw(data).bytes.size()); }

/// Fragments come in order and may overlap.
ddsi_serdata* from_ser(const ddsi_sertype* type, ddsi_serdata_kind kind, const nn_rdata* fragment, size_t size) {
  auto data = receive(type, kind, size);
  if (!data || data->bytes.empty()) return data.release();
  std::size_t done = 0;
  for (; fragment != nullptr; fragment = fragment->nextfrag) {
    if (fragment->maxp1 <= done || fragment->min > done || fragment->maxp1 > data->bytes.size()) continue;
    const unsigned char* payload = NN_RMSG_PAYLOADOFF(fragment->rmsg, NN_RDATA_PAYLOAD_OFF(fragment));
    std::memcpy(data->bytes.data() + done, payload + (done - fragment->min), fragment->maxp1 - done);
    done = fragment->maxp1;
  }
  return data.release();
}

ddsi_serdata* from_ser_iov(const ddsi_sertype* type, ddsi_serdata_kind kind, ddsrt_msg_iovlen_t count,
                           const ddsrt_iovec_t* parts, size_t size) {
  auto data = receive(type, kind, size);
  if (!data || data->bytes.empty()) return data.release();
  std::size_t done = 0;
  for (ddsrt_msg_iovlen_t i = 0; i < count; ++i) {
    const std::size_t bytes = std::min<std::size_t>(parts[i].iov_len, data->bytes.size() - done);
    std::memcpy(data->bytes.data() + done, parts[i].iov_base, bytes);
    done += bytes;
  }
  return data.release();
}

ddsi_serdata* from_keyhash(const ddsi_sertype* type, const ddsi_keyhash* /*hash*/) {
  return new_data(type, SDK_KEY, {}).release();
}

/// Nothing here is written as a sample.
ddsi_serdata* from_sample(const ddsi_sertype* type, ddsi_serdata_kind /*kind*/, const void* /*sample*/) {
  return new_data(type, SDK_KEY, {}).release();
}

void to_ser(const ddsi_serdata* data, size_t offset, size_t size, void* buffer) {
  std::memcpy(buffer, as_raw(data).bytes.data() + offset, size);
}

ddsi_serdata* to_ser_ref(const ddsi_serdata* data, size_t offset, size_t size, ddsrt_iovec_t* part) {
  part->iov_base = const_cast<char*>(as_raw(data).bytes.data() + offset);
  part->iov_len = size;
  return ddsi_serdata_ref(data);
}

void to_ser_unref(ddsi_serdata* data, const ddsrt_iovec_t* /*part*/) { ddsi_serdata_unref(data); }

bool to_sample(const ddsi_serdata* /*data*/, void* /*sample*/, void** /*buffer*/, void* /*end*/) { return false; }

ddsi_serdata* to_untyped(const ddsi_serdata* data) {
  ddsi_serdata* untyped = new_data(data->type, SDK_KEY, {}).release();
  untyped->type = nullptr;
  return untyped;
}

bool untyped_to_sample(const ddsi_sertype* /*type*/, const ddsi_serdata* /*data*/, void* /*sample*/, void** /*buffer*/,
                       void* /*end*/) {
  return true;
}

bool equal_keys(const ddsi_serdata* /*a*/, const ddsi_serdata* /*b*/) { return true; }

void free_data(ddsi_serdata* data) { delete static_cast<RawData*>(data); }

size_t print(const ddsi_sertype* type, const ddsi_serdata* /*data*/, char* buffer, size_t size) {
  return static_cast<size_t>(std::snprintf(buffer, size, "%s", type->type_name));
}

void get_keyhash(const ddsi_serdata* /*data*/, ddsi_keyhash* hash, bool /*force_md5*/) {
  std::memset(hash, 0, sizeof *hash);
}

ddsi_serdata_ops make_data_functions() {
  ddsi_serdata_ops functions{};
  functions.eqkey = equal_keys;
  functions.get_size = get_size;
  functions.from_ser = from_ser;
  functions.from_ser_iov = from_ser_iov;
  functions.from_keyhash = from_keyhash;
  functions.from_sample = from_sample;
  functions.to_ser = to_ser;
  functions.to_ser_ref = to_ser_ref;
  functions.to_ser_unref = to_ser_unref;
  functions.to_sample = to_sample;
  functions.to_untyped = to_untyped;
  functions.untyped_to_sample = untyped_to_sample;
  functions.free = free_data;
  functions.print = print;
  functions.get_keyhash = get_keyhash;
  return functions;
}

void free_type(ddsi_sertype* type) {
  ddsi_sertype_fini(type);
  delete static_cast<RawType*>(type);
}

void zero_samples(const ddsi_sertype* /*type*/, void* /*samples*/, size_t /*count*/) {}

void realloc_samples(void** pointers, const ddsi_sertype* /*type*/, void* /*old*/, size_t /*old_count*/, size_t count) {
  for (size_t i = 0; i < count; ++i) pointers[i] = nullptr;
}

void free_samples(const ddsi_sertype* /*type*/, void** /*pointers*/, size_t /*count*/, dds_free_op_t /*what*/) {}

bool equal_types(const ddsi_sertype* a, const ddsi_sertype* b) { return as_raw(a).max_bytes == as_raw(b).max_bytes; }

uint32_t hash_type(const ddsi_sertype* type) { return static_cast<uint32_t>(as_raw(type).max_bytes); }

ddsi_sertype_ops make_type_functions() {
  ddsi_sertype_ops functions{};
  functions.version = ddsi_sertype_v0;
  functions.free = free_type;
  functions.zero_samples = zero_samples;
  functions.realloc_samples = realloc_samples;
  functions.free_samples = free_samples;
  functions.equal = equal_types;
  functions.hash = hash_type;
  return functions;
}

}  // namespace

ddsi_sertype* make_raw_type(const std::string& name, std::size_t max_bytes) {
  static const ddsi_serdata_ops kDataFunctions = make_data_functions();
  static const ddsi_sertype_ops kTypeFunctions = make_type_functions();
  auto type = std::make_unique<RawType>();
  type->max_bytes = max_bytes;
  ddsi_sertype_init_flags(type.get(), name.c_str(), &kTypeFunctions, &kDataFunctions,
                          DDSI_SERTYPE_FLAG_TOPICKIND_NO_KEY);
  type->allowed_data_representation = DDS_DATA_REPRESENTATION_FLAG_XCDR1;
  return type.release();
}

ddsi_serdata* make_raw_message(const ddsi_sertype& type, std::string cdr) {
  return new_data(&type, SDK_DATA, std::move(cdr)).release();
}

RawMessage raw_message(const ddsi_serdata& data) {
  const RawData& raw = as_raw(&data);
  return {raw.bytes, raw.size, raw.size > raw.bytes.size()};
}

}  // namespace tileflight::ros2
