// Messages between start page and server, as JSON: types only. The server's part is session/door.py.

export interface Listed { number: number; name: string; photos: number; is_flight: boolean; has_project: boolean }
export interface Beginning { folder: number | null; is_chosen: boolean; opens: boolean; recent: Listed[] }
export interface Folders { number: number | null; way: { number: number; name: string }[]; photos: number; is_flight: boolean; has_project: boolean; folders: Listed[] }
export interface FoundPhotos { pattern: string; count: number; width_px: number; height_px: number; example: string; camera: string; looks_deg: number | null }
export interface FoundCamera { name: string; width_px: number; height_px: number }
export interface Setup { pitch_deg: number | "auto"; reading_sigma_m: number; units: "metric" | "imperial" | ""; case: Record<string, string> }
export interface Found {
  number: number; name: string; path: string; has_project: boolean; photos: FoundPhotos[]; cameras: FoundCamera[]; logs: string[]; poses: string[]; gcp_lists: string[]; tables: string[];
  passed_over: string; setup: Setup; camera: string | null; log: string | null; has_gimbal: boolean | null; fault: string;
}
export interface Wanted {
  folder: number; images: string[]; log: string | null; poses: string | null; camera: string | null; gcp_list: string | null; gcp_sigma_m: number; setup: Setup;
}
