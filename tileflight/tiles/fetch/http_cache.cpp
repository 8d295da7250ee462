#include "tileflight/tiles/fetch/http_cache.h"

#include <fcntl.h>
#include <sqlite3.h>
#include <sys/file.h>
#include <sys/stat.h>
#include <unistd.h>
#include <zlib.h>

#include <algorithm>
#include <chrono>
#include <stdexcept>
#include <utility>

#include "tileflight/core/base/input_error.h"

namespace tileflight::fetch {
namespace {

constexpr std::size_t kMaxWaitingBytes = std::size_t{64} << 20;

}  // namespace

HttpCacheWriter::HttpCacheWriter(const HttpCache& cache)
    : cache_(cache.open_second_connection()), thread_([this] { run(); }) {}

HttpCacheWriter::~HttpCacheWriter() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  changed_.notify_all();
  thread_.join();
}

void HttpCacheWriter::store(HttpCache::Entry entry) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return waiting_bytes_ <= kMaxWaitingBytes; });
  const auto before = waiting_.find(entry.key);
  if (before != waiting_.end()) waiting_bytes_ -= before->second.body.size();
  waiting_bytes_ += entry.body.size();
  std::string key = entry.key;
  waiting_.insert_or_assign(std::move(key), std::move(entry));
  changed_.notify_all();
}

void HttpCacheWriter::wait_for(const std::string& key) {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return !waiting_.contains(key) && !in_hand_.contains(key); });
}

void HttpCacheWriter::wait_for_all() {
  std::unique_lock lock(mutex_);
  changed_.wait(lock, [&] { return waiting_.empty() && in_hand_.empty(); });
}

void HttpCacheWriter::run() {
  std::unique_lock lock(mutex_);
  while (true) {
    changed_.wait(lock, [&] { return stopping_ || !waiting_.empty(); });
    if (waiting_.empty()) return;
    in_hand_.swap(waiting_);
    waiting_bytes_ = 0;
    lock.unlock();
    changed_.notify_all();  // the queue has room again
    std::vector<const HttpCache::Entry*> entries;
    for (const auto& [key, entry] : in_hand_) entries.push_back(&entry);
    cache_->store(entries);
    lock.lock();
    in_hand_.clear();
    changed_.notify_all();
  }
}

namespace {

namespace fs = std::filesystem;

// One SQL statement per line; triggers maintain `total`, so that it is correct for all processes.
constexpr const char* kSchema[] = {
    "CREATE TABLE IF NOT EXISTS entry (key TEXT NOT NULL UNIQUE, used_us INTEGER NOT NULL, bytes INTEGER NOT NULL, "
    "fresh_until_s INTEGER NOT NULL, must_revalidate INTEGER NOT NULL, headers TEXT NOT NULL, crc INTEGER NOT NULL, "
    "body BLOB NOT NULL)",
    "CREATE INDEX IF NOT EXISTS entry_used ON entry (used_us)",
    "CREATE TABLE IF NOT EXISTS total (one INTEGER PRIMARY KEY CHECK (one = 1), bytes INTEGER NOT NULL)",
    "INSERT OR IGNORE INTO total VALUES (1, 0)",
    "CREATE TRIGGER IF NOT EXISTS entry_added AFTER INSERT ON entry BEGIN UPDATE total SET bytes = bytes + NEW.bytes; "
    "END",
    "CREATE TRIGGER IF NOT EXISTS entry_gone AFTER DELETE ON entry BEGIN UPDATE total SET bytes = bytes - OLD.bytes; "
    "END",
};

/// The write-ahead log is checkpointed into the database (which waits for the disk) at this many pages, 32 MB: rarely
/// while tiles arrive, and never only because a process ends.
constexpr int kLogPages = 8192;

/// Result of a failed SQLite call.
struct DatabaseError : std::runtime_error {
  DatabaseError(int code_, const std::string& text) : std::runtime_error(text), code(code_ & 0xFF) {}
  bool is_damage() const { return code == SQLITE_CORRUPT || code == SQLITE_NOTADB; }
  /// Another process holds the database for long: this look-up or store is skipped.
  bool is_busy() const { return code == SQLITE_BUSY || code == SQLITE_LOCKED; }

  int code;  ///< primary result code
};

/// Locked while the database is opened, created or set aside; other processes wait.
class FileLock {
 public:
  explicit FileLock(const fs::path& file) : descriptor_(open(file.c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600)) {
    if (descriptor_ >= 0) flock(descriptor_, LOCK_EX);
  }
  FileLock(const FileLock&) = delete;
  FileLock& operator=(const FileLock&) = delete;
  ~FileLock() {
    if (descriptor_ >= 0) close(descriptor_);
  }

 private:
  int descriptor_;
};

/// 0: the file does not exist.
std::uint64_t inode_of(const fs::path& file) {
  struct stat status {};
  return stat(file.c_str(), &status) == 0 ? status.st_ino : 0;
}

std::string text_of(const HttpHeaders& headers) {
  std::string text;
  for (const char* name : {"cache-control", "etag", "last-modified", "date", "expires", "age", "content-type",
                           "tileflight-final-url"}) {  // the last one is HttpSource's own
    if (const auto it = headers.find(name); it != headers.end()) text += std::string(name) + ": " + it->second + "\n";
  }
  return text;
}

HttpHeaders headers_of(const std::string& text) {
  HttpHeaders headers;
  for (std::size_t start = 0; start < text.size();) {
    const std::size_t end = std::min(text.find('\n', start), text.size());
    const std::string line = text.substr(start, end - start);
    const std::size_t colon = line.find(": ");
    if (colon != std::string::npos) headers[line.substr(0, colon)] = line.substr(colon + 2);
    start = end + 1;
  }
  return headers;
}

std::int64_t crc_of(std::span<const std::byte> body) {
  return static_cast<std::int64_t>(crc32_z(0, reinterpret_cast<const Bytef*>(body.data()), body.size()));
}

}  // namespace

/// A prepared statement with its parameters bound in order.
class HttpCache::Statement {
 public:
  Statement(sqlite3* database, const char* sql) : database_(database) {
    check(sqlite3_prepare_v2(database, sql, -1, &statement_, nullptr));
  }
  Statement(const Statement&) = delete;
  Statement& operator=(const Statement&) = delete;
  ~Statement() { sqlite3_finalize(statement_); }

  Statement& bind(const std::string& text) {
    check(sqlite3_bind_text64(statement_, ++bound_, text.data(), text.size(), SQLITE_STATIC, SQLITE_UTF8));
    return *this;
  }
  Statement& bind(std::int64_t number) {
    check(sqlite3_bind_int64(statement_, ++bound_, number));
    return *this;
  }
  Statement& bind(std::span<const std::byte> bytes) {
    static constexpr std::byte kNone{};
    check(
        sqlite3_bind_blob64(statement_, ++bound_, bytes.empty() ? &kNone : bytes.data(), bytes.size(), SQLITE_STATIC));
    return *this;
  }
  /// True: there is a row.
  bool step() {
    const int code = sqlite3_step(statement_);
    if (code != SQLITE_ROW && code != SQLITE_DONE) check(code);
    return code == SQLITE_ROW;
  }
  std::int64_t number(int column) const { return sqlite3_column_int64(statement_, column); }
  std::string text(int column) const {
    const auto bytes = blob(column);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }
  std::span<const std::byte> blob(int column) const {
    const auto* data = static_cast<const std::byte*>(sqlite3_column_blob(statement_, column));
    const int bytes = sqlite3_column_bytes(statement_, column);
    return data == nullptr ? std::span<const std::byte>() : std::span(data, static_cast<std::size_t>(bytes));
  }

  static void execute(sqlite3* database, const char* sql) {
    Statement statement(database, sql);
    while (statement.step()) {
    }
  }

 private:
  void check(int code) const {
    if (code != SQLITE_OK) throw DatabaseError(code, sqlite3_errmsg(database_));
  }

  sqlite3* database_;
  sqlite3_stmt* statement_ = nullptr;
  int bound_ = 0;
};

void HttpCache::Close::operator()(sqlite3* database) const { sqlite3_close_v2(database); }

HttpCache::HttpCache(const fs::path& folder, const HttpCacheOptions& options)
    : file_(folder / "http-1.sqlite"), lock_file_(folder / "http-1.lock"), options_(options) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error || !fs::is_directory(folder)) {
    throw InputError(folder.string(), "the cache folder cannot be created (--no-cache works without it)");
  }
  const std::lock_guard lock(mutex_);
  open();
}

HttpCache::~HttpCache() = default;

std::int64_t HttpCache::now_us() const {
  if (options_.now_us) return options_.now_us();
  const auto now = std::chrono::system_clock::now().time_since_epoch();
  return std::chrono::duration_cast<std::chrono::microseconds>(now).count();
}

void HttpCache::open() {
  try {
    try {
      open_locked();
    } catch (const DatabaseError& error) {
      if (!error.is_damage()) throw;
      begin_anew();
    }
  } catch (const DatabaseError& error) {
    warn_and_stop(error.what());
  }
}

void HttpCache::open_locked() {
  const FileLock lock(lock_file_);
  inode_ = inode_of(file_);
  sqlite3* opened = nullptr;
  const int code = sqlite3_open_v2(file_.c_str(), &opened,
                                   SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_NOMUTEX, nullptr);
  database_.reset(opened);
  if (code != SQLITE_OK) throw DatabaseError(code, sqlite3_errmsg(opened));
  sqlite3_busy_timeout(opened, 10'000);
  sqlite3_db_config(opened, SQLITE_DBCONFIG_DEFENSIVE, 1, nullptr);
  sqlite3_db_config(opened, SQLITE_DBCONFIG_TRUSTED_SCHEMA, 0, nullptr);
  sqlite3_db_config(opened, SQLITE_DBCONFIG_ENABLE_TRIGGER, 1, nullptr);
  sqlite3_db_config(opened, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
  sqlite3_wal_autocheckpoint(opened, kLogPages);
  // An empty database has nothing to lose: creating it does not wait for the disk.
  std::error_code absent;
  const bool is_new = fs::file_size(file_, absent) == 0 || absent;
  if (is_new) Statement::execute(opened, "PRAGMA synchronous = OFF");
  Statement::execute(opened, "PRAGMA journal_mode = WAL");
  Statement::execute(opened, "BEGIN IMMEDIATE");
  for (const char* sql : kSchema) Statement::execute(opened, sql);
  Statement::execute(opened, "COMMIT");
  // After a power failure the cache may lose its last entries, but stays consistent.
  Statement::execute(opened, "PRAGMA synchronous = NORMAL");
  inode_ = inode_of(file_);
}

void HttpCache::begin_anew() {
  database_.reset();
  const fs::path aside = file_.string() + ".damaged";
  {
    const FileLock lock(lock_file_);
    if (inode_of(file_) == inode_) {
      std::error_code ignored;
      fs::rename(file_, aside, ignored);
      for (const char* ending : {"-wal", "-shm"}) fs::remove(file_.string() + ending, ignored);
      warnings_.push_back(file_.string() + ": the cache was damaged; it was renamed to " + aside.filename().string() +
                          " and a new one was started");
    }
  }
  open_locked();
}

void HttpCache::warn_and_stop(const std::string& cause) {
  database_.reset();
  warnings_.push_back(file_.string() + ": the cache cannot be used (" + cause + "); continuing without it");
}

void HttpCache::run(const std::function<void(sqlite3*)>& work) {
  const std::lock_guard lock(mutex_);
  try {
    if (database_) attempt(work);
  } catch (const DatabaseError& error) {
    warn_and_stop(error.what());
  }
}

void HttpCache::attempt(const std::function<void(sqlite3*)>& work) {
  try {
    work(database_.get());
  } catch (const DatabaseError& error) {
    if (sqlite3_get_autocommit(database_.get()) == 0) {
      sqlite3_exec(database_.get(), "ROLLBACK", nullptr, nullptr, nullptr);
    }
    if (error.is_busy()) return;
    if (!error.is_damage()) throw;
    begin_anew();
    work(database_.get());
  }
}

std::optional<CachedResponse> HttpCache::find(const std::string& key) {
  std::optional<CachedResponse> found;
  run([&](sqlite3* database) {
    Statement query(database, "SELECT fresh_until_s, must_revalidate, headers FROM entry WHERE key = ?1");
    if (query.bind(key).step()) found = {headers_of(query.text(2)), query.number(0), query.number(1) != 0};
  });
  return found;
}

std::optional<std::vector<std::byte>> HttpCache::body(const std::string& key) {
  std::optional<std::vector<std::byte>> found;
  bool is_broken = false;
  run([&](sqlite3* database) {
    std::int64_t used_us = 0;
    {
      Statement query(database, "SELECT body, crc, used_us FROM entry WHERE key = ?1");
      if (!query.bind(key).step()) return;
      const std::span<const std::byte> bytes = query.blob(0);
      is_broken = crc_of(bytes) != query.number(1);
      if (!is_broken) found.emplace(bytes.begin(), bytes.end());
      used_us = query.number(2);
    }
    const std::int64_t now = now_us();
    if (is_broken || now - used_us < options_.touch_interval_us) return;
    Statement(database, "UPDATE entry SET used_us = ?1 WHERE key = ?2").bind(now).bind(key).step();
  });
  if (is_broken) remove(key);
  return found;
}

void HttpCache::store(const std::string& key, const CachedResponse& answer, std::span<const std::byte> body) {
  run([&](sqlite3* database) {
    Statement::execute(database, "BEGIN IMMEDIATE");
    put(database, key, answer, body);
    evict(database);
    Statement::execute(database, "COMMIT");
  });
}

void HttpCache::store(std::span<const Entry* const> entries) {
  run([&](sqlite3* database) {
    Statement::execute(database, "BEGIN IMMEDIATE");
    for (const Entry* entry : entries) put(database, entry->key, entry->response, entry->body);
    evict(database);
    Statement::execute(database, "COMMIT");
  });
}

void HttpCache::put(sqlite3* database, const std::string& key, const CachedResponse& answer,
                    std::span<const std::byte> body) {
  const std::string headers = text_of(answer.headers);
  const std::size_t bytes = key.size() + headers.size() + body.size();
  Statement(database, "DELETE FROM entry WHERE key = ?1").bind(key).step();
  if (bytes > options_.max_bytes) return;
  Statement(database, "INSERT INTO entry VALUES (?1, ?2, ?3, ?4, ?5, ?6, ?7, ?8)")
      .bind(key)
      .bind(now_us())
      .bind(static_cast<std::int64_t>(bytes))
      .bind(answer.fresh_until_s)
      .bind(std::int64_t{answer.must_revalidate})
      .bind(headers)
      .bind(crc_of(body))
      .bind(body)
      .step();
}

void HttpCache::evict(sqlite3* database) {
  while (true) {
    Statement total(database, "SELECT bytes FROM total");
    if (!total.step() || static_cast<std::uintmax_t>(total.number(0)) <= options_.max_bytes) return;
    Statement::execute(database,
                       "DELETE FROM entry WHERE rowid = (SELECT rowid FROM entry ORDER BY used_us, rowid LIMIT 1)");
  }
}

void HttpCache::refresh(const std::string& key, const CachedResponse& answer) {
  const std::string headers = text_of(answer.headers);
  run([&](sqlite3* database) {
    Statement(database, "UPDATE entry SET fresh_until_s = ?1, must_revalidate = ?2, headers = ?3 WHERE key = ?4")
        .bind(answer.fresh_until_s)
        .bind(std::int64_t{answer.must_revalidate})
        .bind(headers)
        .bind(key)
        .step();
  });
}

void HttpCache::remove(const std::string& key) {
  run([&](sqlite3* database) { Statement(database, "DELETE FROM entry WHERE key = ?1").bind(key).step(); });
}

std::uintmax_t HttpCache::bytes() {
  std::uintmax_t bytes = 0;
  run([&](sqlite3* database) {
    Statement query(database, "SELECT bytes FROM total");
    if (query.step()) bytes = static_cast<std::uintmax_t>(query.number(0));
  });
  return bytes;
}

std::vector<std::string> HttpCache::warnings() const {
  const std::lock_guard lock(mutex_);
  return warnings_;
}

}  // namespace tileflight::fetch
