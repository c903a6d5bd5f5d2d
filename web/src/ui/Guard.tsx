import { Component, type ReactNode } from "react";

/** A part of the page that fails says so in its place, and the rest goes on. */
export class Guard extends Component<{ of: string; children: ReactNode }, { why: string }> {
  override state = { why: "" };

  static getDerivedStateFromError(error: unknown): { why: string } {
    return { why: error instanceof Error ? error.message : String(error) };
  }

  override render(): ReactNode {
    if (this.state.why === "") return this.props.children;
    return (
      <div className="empty" role="alert">
        <p>
          {this.props.of} cannot be shown: {this.state.why}
        </p>
        <button type="button" className="btn line" onClick={() => this.setState({ why: "" })}>
          Try again
        </button>
      </div>
    );
  }
}
