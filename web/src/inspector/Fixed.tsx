/** What one sees and cannot change. */
export function Fixed({ name, value, title }: { name: string; value: string; title?: string }) {
  return (
    <div className="par" title={title}>
      <span className="second name">{name.replaceAll("_", " ")}</span>
      <span className="num" style={{ gridColumn: "2 / 4", overflowWrap: "anywhere" }}>
        {value}
      </span>
    </div>
  );
}
